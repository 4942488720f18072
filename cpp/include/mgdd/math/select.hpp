// Branch-free helpers of lanes.hpp for dual numbers, so that one template serves double, Lanes and Dual. The branch
// follows the value, as the plain code does; the derivative is that of the branch taken.
#pragma once

#include "mgdd/math/dual.hpp"
#include "mgdd/math/lanes.hpp"

namespace mgdd {

template <int N>
constexpr Dual<N> select(bool condition, const Dual<N>& yes, const Dual<N>& no) noexcept {
  return condition ? yes : no;
}
template <int N>
constexpr Dual<N> smaller(const Dual<N>& a, const Dual<N>& b) noexcept {
  return b < a ? b : a;
}
template <int N>
constexpr Dual<N> larger(const Dual<N>& a, const Dual<N>& b) noexcept {
  return a < b ? b : a;
}
/// `magnitude`, negated where `from` is negative; zero counts as positive.
template <int N>
constexpr Dual<N> with_sign(const Dual<N>& magnitude, const Dual<N>& from) noexcept {
  return from.value < 0.0 ? -magnitude : magnitude;
}

/// exp and tanh of double, Dual and Lanes under one name.
inline double exp_of(double x) noexcept {
  return std::exp(x);
}
template <int N>
Dual<N> exp_of(const Dual<N>& x) noexcept {
  return exp(x);
}
template <int N>
Lanes<N> exp_of(const Lanes<N>& x) noexcept {
  return each(x, [](double v) { return std::exp(v); });
}
inline double tanh_of(double x) noexcept {
  return std::tanh(x);
}
template <int N>
Dual<N> tanh_of(const Dual<N>& x) noexcept {
  return tanh(x);
}
template <int N>
Lanes<N> tanh_of(const Lanes<N>& x) noexcept {
  return each(x, [](double v) { return std::tanh(v); });
}

}  // namespace mgdd
