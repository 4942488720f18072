// Lanes<N>: N doubles that take the same path through one formula, so that N simulations cost little more than one.
// Dimensionless; every operation is noexcept, allocation-free and rounds as the same operation on a double does, so a
// lane holds the bits that the plain code would. Branches become `select`, which both scalars understand.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include "mgdd/math/dispatch.hpp"

namespace mgdd {

namespace detail {

/// Vectors of GCC and Clang; a type of its own because the attribute does not wait for a template argument.
// NOLINTBEGIN(modernize-use-using): an alias drops the attribute.
template <int N>
struct LaneVector {
  typedef double Numbers __attribute__((vector_size(N * 8)));
  typedef std::int64_t Bits __attribute__((vector_size(N * 8)));
};
// NOLINTEND(modernize-use-using)

}  // namespace detail

template <int N>
struct LaneMask {
  typename detail::LaneVector<N>::Bits bits;  ///< all ones where true

  MGDD_INLINE friend LaneMask operator&(const LaneMask& a, const LaneMask& b) noexcept { return {a.bits & b.bits}; }
  MGDD_INLINE friend LaneMask operator|(const LaneMask& a, const LaneMask& b) noexcept { return {a.bits | b.bits}; }
  MGDD_INLINE friend LaneMask operator!(const LaneMask& a) noexcept { return {~a.bits}; }
};

template <int N>
struct Lanes {
  static_assert(N >= 2 && (N & (N - 1)) == 0, "a power of two");
  using Vector = typename detail::LaneVector<N>::Numbers;
  Vector v{};

  Lanes() noexcept = default;
  MGDD_INLINE Lanes(double all) noexcept : v(Vector{} + all) {}  // NOLINT(google-explicit-constructor): a constant
  MGDD_INLINE explicit Lanes(const Vector& vector) noexcept : v(vector) {}
  MGDD_INLINE static Lanes load(const double* first) noexcept {
    Lanes lanes(0.0);
    for (int i = 0; i < N; ++i)
      lanes.v[i] = first[i];
    return lanes;
  }
  MGDD_INLINE void store(double* first) const noexcept {
    for (int i = 0; i < N; ++i)
      first[i] = v[i];
  }
  MGDD_INLINE double operator[](int lane) const noexcept { return v[lane]; }
  MGDD_INLINE void set(int lane, double value) noexcept { v[lane] = value; }

  MGDD_INLINE friend Lanes operator-(const Lanes& a) noexcept { return Lanes(-a.v); }
  MGDD_INLINE friend Lanes operator+(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v + b.v); }
  MGDD_INLINE friend Lanes operator-(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v - b.v); }
  MGDD_INLINE friend Lanes operator*(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v * b.v); }
  MGDD_INLINE friend Lanes operator/(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v / b.v); }
  MGDD_INLINE Lanes& operator+=(const Lanes& o) noexcept { return v += o.v, *this; }
  MGDD_INLINE Lanes& operator-=(const Lanes& o) noexcept { return v -= o.v, *this; }
  MGDD_INLINE Lanes& operator*=(const Lanes& o) noexcept { return v *= o.v, *this; }
  MGDD_INLINE friend LaneMask<N> operator<(const Lanes& a, const Lanes& b) noexcept { return {a.v < b.v}; }
  MGDD_INLINE friend LaneMask<N> operator>(const Lanes& a, const Lanes& b) noexcept { return {a.v > b.v}; }
  MGDD_INLINE friend LaneMask<N> operator<=(const Lanes& a, const Lanes& b) noexcept { return {a.v <= b.v}; }
  MGDD_INLINE friend LaneMask<N> operator>=(const Lanes& a, const Lanes& b) noexcept { return {a.v >= b.v}; }
  MGDD_INLINE friend LaneMask<N> operator==(const Lanes& a, const Lanes& b) noexcept { return {a.v == b.v}; }
};

/// `yes` where the mask is set, otherwise `no`; both are computed.
template <int N>
MGDD_INLINE Lanes<N> select(const LaneMask<N>& mask, const Lanes<N>& yes, const Lanes<N>& no) noexcept {
  return Lanes<N>(mask.bits ? yes.v : no.v);
}
template <std::floating_point S>
MGDD_INLINE S select(bool condition, S yes, S no) noexcept {
  return condition ? yes : no;
}

template <int N>
MGDD_INLINE Lanes<N> abs(const Lanes<N>& a) noexcept {
  return select(a < Lanes<N>(0.0), -a, a);
}
/// `b` if it is smaller, otherwise `a`: NaN in `a` stays, as with std::min.
template <int N>
MGDD_INLINE Lanes<N> smaller(const Lanes<N>& a, const Lanes<N>& b) noexcept {
  return select(b < a, b, a);
}
template <int N>
MGDD_INLINE Lanes<N> larger(const Lanes<N>& a, const Lanes<N>& b) noexcept {
  return select(a < b, b, a);
}
template <std::floating_point S>
MGDD_INLINE S smaller(S a, S b) noexcept {
  return b < a ? b : a;
}
template <std::floating_point S>
MGDD_INLINE S larger(S a, S b) noexcept {
  return a < b ? b : a;
}
/// |magnitude| with the sign of `from`; zero counts as positive.
template <int N>
MGDD_INLINE Lanes<N> with_sign(const Lanes<N>& magnitude, const Lanes<N>& from) noexcept {
  return select(from < Lanes<N>(0.0), -magnitude, magnitude);
}
template <std::floating_point S>
MGDD_INLINE S with_sign(S magnitude, S from) noexcept {
  return from < S(0) ? -magnitude : magnitude;
}

/// A function of one number on every lane, for what has no vector instruction.
template <int N, class Function>
MGDD_INLINE Lanes<N> each(const Lanes<N>& a, Function function) noexcept {
  Lanes<N> result(0.0);
  for (int i = 0; i < N; ++i)
    result.v[i] = function(a.v[i]);
  return result;
}
template <std::floating_point S, class Function>
MGDD_INLINE S each(S a, Function function) noexcept {
  return function(a);
}

}  // namespace mgdd
