// Random numbers: published vectors, then the laws of the normal and uniform distribution, then golden bits.
#include "mgdd/common/random.hpp"

#include "support/test.hpp"

namespace mgdd::random {
namespace {

static_assert(noexcept(normal(0, 0, 0)) && noexcept(uniform(0, 0, 0)) && noexcept(bernoulli(0.5, 0, 0, 0)));

// Known answers published with the generator: counter, key, result.
TEST(Philox, GivesThePublishedAnswers) {
  EXPECT_EQ(philox4x32({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t ones = 0xffffffff;
  EXPECT_EQ(philox4x32({ones, ones, ones, ones}, {ones, ones}),
            (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Philox, IndexStreamAndSeedReachTheCounterAndTheKeyInFull) {
  const auto of = [](const Block& b) {
    return static_cast<std::uint64_t>(b[0]) | static_cast<std::uint64_t>(b[1]) << 32;
  };
  EXPECT_EQ(bits(0x0000000200000001, 0x0000000400000003, 0x0000000600000005), of(philox4x32({5, 6, 3, 4}, {1, 2})));
}

TEST(Uniform, StaysOpenAndHasItsMoments) {
  constexpr int n = 200000;
  double mean = 0.0, square = 0.0, least = 1.0, most = 0.0;
  for (int i = 0; i < n; ++i) {
    const double u = uniform(7, 0, static_cast<std::uint64_t>(i));
    mean += u / n;
    square += (u - 0.5) * (u - 0.5) / n;
    least = std::min(least, u);
    most = std::max(most, u);
  }
  EXPECT_NEAR(mean, 0.5, 4.0 * std::sqrt(1.0 / 12.0 / n));
  EXPECT_NEAR(square, 1.0 / 12.0, 4.0 * std::sqrt(1.0 / 180.0 / n));
  EXPECT_GT(least, 0.0);
  EXPECT_LT(most, 1.0);
}

// Against the definition of the distribution function, which shares nothing with the approximation.
TEST(NormalQuantile, InvertsTheDistributionFunctionInEveryBranch) {
  for (double x = -8.0; x <= 8.0; x += 0.03125) {
    const double below = 0.5 * std::erfc(std::abs(x) / std::sqrt(2.0));
    EXPECT_NEAR(normal_quantile(below), -std::abs(x), 4e-15 * std::max(1.0, std::abs(x))) << x;
  }
  EXPECT_EQ(normal_quantile(0.5), 0.0);
  for (const double p : {0.01, 0.0749, 0.0751, 0.25})
    EXPECT_NEAR(normal_quantile(1.0 - p), -normal_quantile(p), 1e-14);
  for (const double p : {0.0, 1.0, -1.0, 2.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_TRUE(std::isnan(normal_quantile(p))) << p;
}

TEST(Normal, HasTheSameBitsOnEveryMachine) {
  EXPECT_EQ(normal(42, 3, 0), -0x1.1800d24500022p-3);
  EXPECT_EQ(normal(42, 3, 1), -0x1.32a0b14bcc579p+0);
  EXPECT_EQ(normal(42, 3, 2), 0x1.433d63f55e291p+0);
  EXPECT_EQ(normal(42, 3, 3), 0x1.29f7598772792p-1);
}

TEST(Bernoulli, HitsItsRateAndItsEdges) {
  constexpr int n = 100000;
  int hits = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    hits += bernoulli(0.02, 1, 2, i);
    EXPECT_FALSE(bernoulli(0.0, 1, 2, i));
    EXPECT_TRUE(bernoulli(1.0, 1, 2, i));
  }
  EXPECT_NEAR(hits, 0.02 * n, 4.0 * std::sqrt(0.02 * 0.98 * n));
}

}  // namespace
}  // namespace mgdd::random
