// Dual<N, S>: a number S (double, float) with N directional derivatives, for exact forward sensitivities (no finite
// differences). Dimensionless; all operations are noexcept and allocation-free. Any template on a scalar runs with it
// unchanged. Source: Griewank and Walther 2008, chapter 3 (forward mode). Branches follow the value, as the plain code
// does.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <type_traits>

namespace mgdd {

namespace detail {

/// The narrowest vector that every x86-64 and 64-bit ARM has; an attribute does not wait for a template argument.
template <std::floating_point S>
struct Pack {
  typedef S Numbers __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): an alias drops the attribute
};

}  // namespace detail

/// N derivatives, in vectors where they fill them: of an array GCC moves every number by itself, and a run with twelve
/// takes two to three times as long.
template <int N, std::floating_point S>
struct Gradient {
  static constexpr bool fills = N * sizeof(S) % 16 == 0;
  using Part = std::conditional_t<fills, typename detail::Pack<S>::Numbers, S>;
  std::array<Part, static_cast<std::size_t>(N) * sizeof(S) / sizeof(Part)> parts{};

  constexpr Gradient() noexcept = default;
  Gradient(std::initializer_list<S> numbers) noexcept { std::ranges::copy(numbers, begin()); }

  static constexpr std::size_t size() noexcept { return static_cast<std::size_t>(N); }
  // A vector may be read as the numbers that it is made of.
  S* data() noexcept { return reinterpret_cast<S*>(parts.data()); }
  const S* data() const noexcept { return reinterpret_cast<const S*>(parts.data()); }
  S& operator[](std::size_t i) noexcept { return data()[i]; }
  const S& operator[](std::size_t i) const noexcept { return data()[i]; }
  S* begin() noexcept { return data(); }
  S* end() noexcept { return data() + N; }
  const S* begin() const noexcept { return data(); }
  const S* end() const noexcept { return data() + N; }
  void fill(S number) noexcept { std::ranges::fill(*this, number); }
  bool operator==(const Gradient& o) const noexcept { return std::ranges::equal(*this, o); }
};

template <int N, std::floating_point S = double>
struct Dual {
  static_assert(N > 0);
  using Scalar = S;
  Gradient<N, S> grad{};  // before the value: 1.6 times faster than after it
  S value{};

  constexpr Dual() noexcept = default;
  /// A constant is a dual; of any width, so that a literal serves float too.
  template <std::floating_point V>
  constexpr Dual(V v) noexcept : value(static_cast<S>(v)) {}  // NOLINT(google-explicit-constructor)

  /// The variable itself along direction `i`.
  static Dual seeded(S v, int i) noexcept {
    Dual d(v);
    d.grad[static_cast<std::size_t>(i)] = S(1);
    return d;
  }

  Dual& operator+=(const Dual& o) noexcept {
    value += o.value;
    for (std::size_t i = 0; i < grad.parts.size(); ++i)
      grad.parts[i] += o.grad.parts[i];
    return *this;
  }
  Dual& operator-=(const Dual& o) noexcept {
    value -= o.value;
    for (std::size_t i = 0; i < grad.parts.size(); ++i)
      grad.parts[i] -= o.grad.parts[i];
    return *this;
  }
  Dual& operator*=(const Dual& o) noexcept {
    for (std::size_t i = 0; i < grad.parts.size(); ++i)
      grad.parts[i] = grad.parts[i] * o.value + value * o.grad.parts[i];
    value *= o.value;
    return *this;
  }
  Dual& operator*=(S o) noexcept {
    for (auto& part : grad.parts)
      part *= o;
    value *= o;
    return *this;
  }
  Dual& operator/=(const Dual& o) noexcept {
    const S inverse = S(1) / o.value;
    value *= inverse;
    for (std::size_t i = 0; i < grad.parts.size(); ++i)
      grad.parts[i] = (grad.parts[i] - value * o.grad.parts[i]) * inverse;
    return *this;
  }

  friend Dual operator-(Dual a) noexcept { return a *= S(-1); }
  friend Dual operator+(Dual a, const Dual& b) noexcept { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) noexcept { return a -= b; }
  friend Dual operator*(Dual a, const Dual& b) noexcept { return a *= b; }
  friend Dual operator/(Dual a, const Dual& b) noexcept { return a /= b; }
  friend Dual operator+(Dual a, S b) noexcept { return a.value += b, a; }
  friend Dual operator+(S a, Dual b) noexcept { return b.value += a, b; }
  friend Dual operator-(Dual a, S b) noexcept { return a.value -= b, a; }
  friend Dual operator-(S a, Dual b) noexcept { return a + (-b); }
  friend Dual operator*(Dual a, S b) noexcept { return a *= b; }
  friend Dual operator*(S a, Dual b) noexcept { return b *= a; }
  friend Dual operator/(Dual a, S b) noexcept { return a *= S(1) / b; }

  bool operator==(const Dual&) const = default;  ///< value and derivatives; order compares values only
  friend bool operator<(const Dual& a, const Dual& b) noexcept { return a.value < b.value; }
  friend bool operator>(const Dual& a, const Dual& b) noexcept { return a.value > b.value; }
  friend bool operator<=(const Dual& a, const Dual& b) noexcept { return a.value <= b.value; }
  friend bool operator>=(const Dual& a, const Dual& b) noexcept { return a.value >= b.value; }
};

template <class T>
struct is_dual : std::false_type {};
template <int N, class S>
struct is_dual<Dual<N, S>> : std::true_type {};
template <class T>
inline constexpr bool is_dual_v = is_dual<T>::value;

/// Value with the derivative of the outer function applied: f(x) with f'(x) = slope.
template <int N, class S>
Dual<N, S> chain(std::type_identity_t<S> f, std::type_identity_t<S> slope, const Dual<N, S>& x) noexcept {
  Dual<N, S> y(f);
  for (std::size_t i = 0; i < x.grad.parts.size(); ++i)
    y.grad.parts[i] = slope * x.grad.parts[i];
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
  for (std::size_t i = 0; i < y.grad.parts.size(); ++i)
    y.grad.parts[i] += by_exponent * exponent.grad.parts[i];
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
