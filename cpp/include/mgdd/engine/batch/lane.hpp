// Sixteen numbers side by side, one for each cycle of a block: plain ones, or dual ones with values and derivatives in
// rows of their own, so that a loop over the lanes becomes vectors in both cases. noexcept, no heap.
#pragma once

#include <array>
#include <cstddef>

#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/lane_functions.hpp"
#include "mgdd/math/select.hpp"

namespace mgdd::engine {

inline constexpr std::size_t block_lanes = 16;

template <class T>
struct Lane;

template <>
struct Lane<double> {
  std::array<double, block_lanes> value;

  MGDD_INLINE double get(std::size_t l) const noexcept { return value[l]; }
  MGDD_INLINE void set(std::size_t l, double x) noexcept { value[l] = x; }
  void fill(double x) noexcept { value.fill(x); }
};

template <>
struct Lane<Dual<1>> {
  std::array<double, block_lanes> value, grad;

  MGDD_INLINE Dual<1> get(std::size_t l) const noexcept {
    Dual<1> x(value[l]);
    x.grad[0] = grad[l];
    return x;
  }
  MGDD_INLINE void set(std::size_t l, const Dual<1>& x) noexcept {
    value[l] = x.value;
    grad[l] = x.grad[0];
  }
  void fill(const Dual<1>& x) noexcept {
    value.fill(x.value);
    grad.fill(x.grad[0]);
  }
};

/// x^exponent whose value is known already, with the derivative where there is one; its slope at zero counts as zero.
MGDD_INLINE double with_power(double power, double, double) noexcept {
  return power;
}
template <int N>
MGDD_INLINE Dual<N> with_power(double power, double exponent, const Dual<N>& x) noexcept {
  const double slope = exponent * power / x.value;
  return chain(power, x.value > 0.0 ? slope : 0.0, x);
}

template <int N>
MGDD_INLINE Dual<N> lane_exp(const Dual<N>& x) noexcept {
  const double e = mgdd::lane_exp(x.value);
  return chain(e, e, x);
}
template <int N>
MGDD_INLINE Dual<N> lane_log(const Dual<N>& x) noexcept {
  return chain(mgdd::lane_log(x.value), 1.0 / x.value, x);
}
using mgdd::lane_exp;
using mgdd::lane_log;

}  // namespace mgdd::engine
