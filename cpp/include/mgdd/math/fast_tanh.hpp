// Hyperbolic tangent without branches or tables, for a double or a vector of them (SIMD lanes). Dimensionless;
// noexcept, no heap. Relative error below 1e-15 for every finite argument; NaN stays NaN. Only + - * / and bit shifts,
// so that every lane width gives the same bits. Method: tanh x = e/(e + 2) with e = exp(2|x|) - 1, range reduction by
// ln 2 in two parts and the Taylor polynomial of exp(r) - 1 on |r| <= ln(2)/2, whose
// first left-out term is 5e-16 of the result.
#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

namespace mgdd {

/// Integers as wide as the values: int64 for a double, a vector of int64 for a vector of doubles.
template <class V>
struct LaneBits {
  using type = decltype(V{} < V{});
};
template <>
struct LaneBits<double> {
  using type = std::int64_t;
};

/// exp(r) - 1 for |r| <= ln(2)/2; in Estrin's order, whose chain of dependent operations is short.
template <class V>
[[gnu::always_inline]] inline V small_expm1(const V& r) noexcept {
  const V r2 = r * r;
  const V r4 = r2 * r2;
  const V a = 1.0 / 2 + r * (1.0 / 6);
  const V b = 1.0 / 24 + r * (1.0 / 120);
  const V c = 1.0 / 720 + r * (1.0 / 5040);
  const V d = 1.0 / 40320 + r * (1.0 / 362880);
  const V e = 1.0 / 3628800 + r * (1.0 / 39916800) + r2 * (1.0 / 479001600);
  return r + r2 * (a + r2 * b + r4 * (c + r2 * d + r4 * e));
}

template <class V>
[[gnu::always_inline]] inline V fast_tanh(const V& x) noexcept {
  using Bits = typename LaneBits<V>::type;
  constexpr double over_ln2 = 0x1.71547652b82fep+0;
  constexpr double ln2_high = 0x1.62e42fee00000p-1;  // 21 trailing zero bits: k ln2_high is exact
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  constexpr double round_to_integer = 0x1.8p52;  // its low bits then hold the integer
  constexpr double largest = 44.0;               // tanh(22) is 1 in double
  const V twice = x + x;
  const V positive = twice < 0.0 ? -twice : twice;
  const V z = positive > largest ? V{} + largest : positive;
  const V shifted = z * over_ln2 + round_to_integer;
  const V k = shifted - round_to_integer;
  const V r = (z - k * ln2_high) - k * ln2_low;
  const V scale = std::bit_cast<V>((std::bit_cast<Bits>(shifted) + 1023) << 52);  // 2^k
  const V e = scale * small_expm1(r) + (scale - 1.0);
  const V t = e / (e + 2.0);
  return x < 0.0 ? -t : t;
}

}  // namespace mgdd
