// Branch-free helpers of lanes.hpp for dual numbers, so that one template serves double, Lanes and Dual. The branch
// follows the value, as the plain code does; the derivative is that of the branch taken.
#pragma once

#include <type_traits>

#include "mgdd/math/dual.hpp"
#include "mgdd/math/lanes.hpp"

namespace mgdd {

template <int N, class S>
Dual<N, S> select(bool condition, const Dual<N, S>& yes, const Dual<N, S>& no) noexcept {
  return condition ? yes : no;
}
template <int N, class S>
Dual<N, S> smaller(const Dual<N, S>& a, const Dual<N, S>& b) noexcept {
  return b < a ? b : a;
}
template <int N, class S>
Dual<N, S> larger(const Dual<N, S>& a, const Dual<N, S>& b) noexcept {
  return a < b ? b : a;
}
/// `magnitude`, negated where `from` is negative; zero counts as positive.
template <int N, class S>
Dual<N, S> with_sign(const Dual<N, S>& magnitude, const Dual<N, S>& from) noexcept {
  return from.value < S(0) ? -magnitude : magnitude;
}

/// The plain number under a dual; another scalar is its own.
template <class T>
struct PlainScalar {
  using type = T;
};
template <int N, class S>
struct PlainScalar<Dual<N, S>> {
  using type = S;
};

/// A coefficient as the scalar of a state: itself where they are the same.
template <class T, class C>
MGDD_INLINE decltype(auto) widened(const C& c) noexcept {
  if constexpr (std::is_same_v<T, C>) {
    return (c);
  } else {
    return T(c);
  }
}

/// A constant as a scalar, or in every element of a raw vector of the compiler.
template <class T>
MGDD_INLINE T constant_of(double value) noexcept {
  if constexpr (std::is_class_v<T> || std::is_floating_point_v<T>) {
    return T(value);
  } else {
    return T{} + value;
  }
}

/// Functions of every scalar under one name.
template <std::floating_point S>
S exp_of(S x) noexcept {
  return std::exp(x);
}
template <std::floating_point S>
S tanh_of(S x) noexcept {
  return std::tanh(x);
}
template <std::floating_point S>
S pow_of(S x, S exponent) noexcept {
  return std::pow(x, exponent);
}
template <int N, class S>
Dual<N, S> exp_of(const Dual<N, S>& x) noexcept {
  return exp(x);
}
template <int N, class S>
Dual<N, S> tanh_of(const Dual<N, S>& x) noexcept {
  return tanh(x);
}
template <int N, class S>
Dual<N, S> pow_of(const Dual<N, S>& x, const Dual<N, S>& exponent) noexcept {
  return pow(x, exponent);
}
template <int N, class S>
Dual<N, S> pow_of(const Dual<N, S>& x, std::type_identity_t<S> exponent) noexcept {
  return pow(x, exponent);
}
template <int N>
MGDD_INLINE Lanes<N> exp_of(const Lanes<N>& x) noexcept {
  return each(x, [](double v) { return std::exp(v); });
}
template <int N>
MGDD_INLINE Lanes<N> tanh_of(const Lanes<N>& x) noexcept {
  return each(x, [](double v) { return std::tanh(v); });
}
template <int N>
MGDD_INLINE Lanes<N> pow_of(const Lanes<N>& x, const Lanes<N>& exponent) noexcept {
  Lanes<N> result(0.0);
  for (int i = 0; i < N; ++i)
    result.v[i] = std::pow(x.v[i], exponent.v[i]);
  return result;
}

}  // namespace mgdd
