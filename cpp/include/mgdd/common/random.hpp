// Counter-based random numbers: a pure function of (seed, stream, index), so that the same draw comes out in any order,
// on any thread and after any restart. Bits: Philox4x32-10 (Salmon, Moraes, Dror and Shaw 2011). Normal: the inverse
// distribution function AS 241 (Wichura 1988) with a logarithm of our own, in + - * / and sqrt only, so that every IEEE
// machine gives the same bits. Dimensionless; noexcept, no state, no heap.
#pragma once

#include <array>
#include <cstdint>

namespace mgdd::random {

using Block = std::array<std::uint32_t, 4>;

/// Ten rounds of Philox on one counter.
constexpr Block philox4x32(Block counter, std::array<std::uint32_t, 2> key) noexcept {
  constexpr std::uint64_t first_multiplier = 0xD2511F53u, second_multiplier = 0xCD9E8D57u;
  constexpr std::uint32_t first_weyl = 0x9E3779B9u, second_weyl = 0xBB67AE85u;  // golden ratio, sqrt(3) - 1
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = first_multiplier * counter[0];
    const std::uint64_t b = second_multiplier * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key = {key[0] + first_weyl, key[1] + second_weyl};
  }
  return counter;
}

/// 64 random bits: seed is the key, index and stream the counter.
constexpr std::uint64_t bits(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) noexcept {
  const Block block = philox4x32({static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(index >> 32),
                                  static_cast<std::uint32_t>(stream), static_cast<std::uint32_t>(stream >> 32)},
                                 {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)});
  return static_cast<std::uint64_t>(block[0]) | static_cast<std::uint64_t>(block[1]) << 32;
}

/// Uniform on the open interval (0, 1): the middles of 2^52 equal cells, so symmetric about 1/2.
constexpr double uniform(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) noexcept {
  return (static_cast<double>(bits(seed, stream, index) >> 12) + 0.5) * 0x1p-52;
}

constexpr bool bernoulli(double probability, std::uint64_t seed, std::uint64_t stream, std::uint64_t index) noexcept {
  return uniform(seed, stream, index) < probability;
}

/// x with P(normal < x) = p for p in (0, 1), relative error about 1e-16; NaN elsewhere.
double normal_quantile(double p) noexcept;

/// Standard normal number.
double normal(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) noexcept;

}  // namespace mgdd::random
