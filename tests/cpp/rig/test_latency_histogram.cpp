// The histogram of times: quantiles that never understate, an exact largest time, and reading while adding.
#include "mgdd/rig/latency_histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

namespace mgdd::rig {
namespace {

TEST(LatencyHistogram, EdgesAreEvenOnALogarithmicScale) {
  using H = LatencyHistogram;
  EXPECT_EQ(H::upper_edge_ns(0), 100);
  EXPECT_EQ(H::upper_edge_ns(8), 1'000);
  EXPECT_EQ(H::upper_edge_ns(56), 1'000'000'000);
  EXPECT_EQ(H::upper_edge_ns(63), std::numeric_limits<std::int64_t>::max());
  for (std::size_t i = 0; i < 63; ++i) {
    EXPECT_NEAR(static_cast<double>(H::upper_edge_ns(i)), 100.0 * std::pow(10.0, static_cast<double>(i) / 8.0), 0.51);
  }
}

TEST(LatencyHistogram, EveryTimeFallsBetweenItsEdges) {
  for (const std::int64_t t : {0L, 99L, 100L, 101L, 132L, 133L, 134L, 999'999'999L, 1'000'000'000L, 6'000'000'000L}) {
    LatencyHistogram h;
    h.add(t);
    const auto counts = h.counts();
    const auto bin = static_cast<std::size_t>(std::find(counts.begin(), counts.end(), 1u) - counts.begin());
    ASSERT_LT(bin, counts.size());
    EXPECT_LT(t, LatencyHistogram::upper_edge_ns(bin));
    EXPECT_TRUE(bin == 0 || t >= LatencyHistogram::upper_edge_ns(bin - 1)) << t;
  }
}

TEST(LatencyHistogram, OfNothing) {
  const LatencyHistogram h;
  EXPECT_EQ(h.count(), 0u);
  EXPECT_EQ(h.max_ns(), 0);
  EXPECT_EQ(h.mean_ns(), 0.0);
  EXPECT_EQ(h.quantile_ns(0.99), 0);
}

TEST(LatencyHistogram, QuantilesOfASampleAreNeverTooSmallAndAtMostAThirdTooLarge) {
  std::mt19937_64 random(5);
  std::lognormal_distribution<double> skewed(11.0, 1.7);  // around 60 us, a long tail
  std::vector<std::int64_t> times(20'000);
  LatencyHistogram h;
  for (auto& t : times) {
    t = 100 + static_cast<std::int64_t>(skewed(random));
    h.add(t);
  }
  std::sort(times.begin(), times.end());
  for (const double q : {0.001, 0.25, 0.5, 0.9, 0.99, 0.999}) {
    const auto exact = times[static_cast<std::size_t>(std::ceil(q * 20'000.0)) - 1];
    EXPECT_GE(h.quantile_ns(q), exact) << q;
    EXPECT_LE(static_cast<double>(h.quantile_ns(q)), 1.34 * static_cast<double>(exact)) << q;
  }
  EXPECT_EQ(h.quantile_ns(1.0), times.back());
  EXPECT_EQ(h.max_ns(), times.back());
  EXPECT_EQ(h.count(), 20'000u);
  EXPECT_DOUBLE_EQ(h.mean_ns(), std::accumulate(times.begin(), times.end(), 0.0) / 20'000.0);
}

TEST(LatencyHistogram, AQuantileOfOneTimeIsThatTime) {
  LatencyHistogram h;
  h.add(-5);
  EXPECT_EQ(h.quantile_ns(0.5), 0);
  LatencyHistogram other;
  other.add(9'000'000'000);
  EXPECT_EQ(other.quantile_ns(0.0), 9'000'000'000);
}

TEST(LatencyHistogram, CanBeCopiedWhileAnotherThreadAdds) {
  LatencyHistogram h;
  constexpr std::uint64_t n = 20'000;
  const std::jthread writer([&] {
    for (std::uint64_t i = 0; i < n; ++i)
      h.add(static_cast<std::int64_t>(i));
  });
  std::uint64_t last = 0;
  while (last < n) {
    const LatencyHistogram copy = h;  // NOLINT(performance-unnecessary-copy-initialization): copying is the test
    EXPECT_GE(copy.count(), last);
    last = copy.count();
    std::this_thread::yield();
  }
}

}  // namespace
}  // namespace mgdd::rig
