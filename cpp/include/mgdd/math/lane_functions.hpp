// exp, log and fifth roots of a double without branches, tables or calls, for loops over lanes that the compiler turns
// into vectors: only + - * / and bit operations, so that every vector width gives the same bits. Dimensionless;
// noexcept, no heap. Errors stand at each function, for normal positive arguments; a NaN stays NaN but for the
// logarithm. Methods: series after reduction by powers of two; for the root a linear guess from the bits (Blinn 1997)
// and two steps of the binomial series.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/fast_tanh.hpp"
#include "mgdd/math/lanes.hpp"

namespace mgdd {
namespace detail {

inline constexpr double integer_bits = 0x1p52;  ///< an integer below 2^52 added to it stands in its low bits

/// The upper half of the bits as a number.
MGDD_INLINE double upper_bits(double x) noexcept {
  return std::bit_cast<double>((std::bit_cast<std::uint64_t>(x) >> 32) | std::bit_cast<std::uint64_t>(integer_bits)) -
         integer_bits;
}
/// The double whose upper half is that integer.
MGDD_INLINE double of_upper_bits(double integer) noexcept {
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(integer + integer_bits) << 32);
}

}  // namespace detail

// The root stands in three parts, because a loop over lanes that does one part at a time waits less for its results.

/// x^(-1/5) to 4 %: linear in the bits, as a logarithm nearly is.
MGDD_INLINE double inverse_fifth_root_guess(double x) noexcept {
  constexpr double one = 1023.0 * 0x1p20;    // upper bits of 1.0
  constexpr double balance = 0.06 * 0x1p20;  // equal errors on both sides
  return detail::of_upper_bits((1.2 * one - balance) - 0.2 * detail::upper_bits(x));
}
/// x^(-1/5) to 2e-7 from the guess.
MGDD_INLINE double inverse_fifth_root_first(double x, double guess) noexcept {
  const double square = guess * guess;
  const double h = 1.0 - (square * square) * (x * guess);
  const double h2 = h * h;  // binomial series of (1 - h)^(-1/5)
  return guess + (guess * h) * ((0.2 + h * 0.12) + h2 * ((0.088 + h * 0.0704) + h2 * (0.059136 + h * 0.0512512)));
}
/// x^(4/5) to 1e-15 from the result of the first part; zero at zero.
MGDD_INLINE double four_fifths_last(double x, double root) noexcept {
  const double square = root * root;
  const double power = x * root;
  const double h = 1.0 - (square * square) * power;
  return power + (power * h) * (0.2 + h * 0.12);
}
MGDD_INLINE double lane_four_fifths(double x) noexcept {
  return four_fifths_last(x, inverse_fifth_root_first(x, inverse_fifth_root_guess(x)));
}

/// exp(x) to 5e-16 for |x| <= 700, the value at that end beyond.
MGDD_INLINE double lane_exp(double x) noexcept {
  constexpr double over_ln2 = 0x1.71547652b82fep+0;
  constexpr double ln2_high = 0x1.62e42fee00000p-1;  // 21 trailing zero bits: k ln2_high is exact
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  constexpr double round_to_integer = 0x1.8p52;
  const double above = x < -700.0 ? -700.0 : x;
  const double z = above > 700.0 ? 700.0 : above;
  const double shifted = z * over_ln2 + round_to_integer;
  const double k = shifted - round_to_integer;
  const double r = (z - k * ln2_high) - k * ln2_low;
  const double scale = std::bit_cast<double>((std::bit_cast<std::uint64_t>(shifted) + 1023U) << 52U);  // 2^k
  return scale + scale * small_expm1(r);
}

/// ln(x) to 4e-16 of the larger of 1 and the result.
MGDD_INLINE double lane_log(double x) noexcept {
  constexpr double ln2 = 0x1.62e42fefa39efp-1;
  constexpr auto one = std::uint64_t{1023} << 52U;
  constexpr auto root_half = std::bit_cast<std::uint64_t>(0x1.6a09e667f3bcdp-1);
  // x = 2^k m with m in [sqrt(1/2), sqrt(2))
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x) + (one - root_half);
  const double k = std::bit_cast<double>((bits >> 52U) | std::bit_cast<std::uint64_t>(detail::integer_bits)) -
                   (detail::integer_bits + 1023.0);
  const double m = std::bit_cast<double>((bits & 0x000fffffffffffffU) + root_half);
  const double s = (m - 1.0) / (m + 1.0);  // ln m = 2 (s + s^3/3 + s^5/5 + ...), |s| <= 0.172
  const double z = s * s;
  const double z2 = z * z;
  const double z4 = z2 * z2;
  const double a = 1.0 / 3 + z * (1.0 / 5);
  const double b = 1.0 / 7 + z * (1.0 / 9);
  const double c = 1.0 / 11 + z * (1.0 / 13);
  const double d = 1.0 / 15 + z * (1.0 / 17);
  const double e = 1.0 / 19 + z * (1.0 / 21);
  return k * ln2 + 2.0 * (s + s * z * (a + z2 * b + z4 * (c + z2 * d + z4 * e)));
}

/// Elementwise; one instruction where the vector is as wide as the processor's.
template <int N>
MGDD_INLINE Lanes<N> sqrt(const Lanes<N>& a) noexcept {
  return each(a, [](double x) MGDD_INLINE_LAMBDA { return std::sqrt(x); });
}

}  // namespace mgdd
