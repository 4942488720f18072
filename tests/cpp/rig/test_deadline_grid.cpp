// Deadlines on their grid, and the histogram of what was late.
#include <numeric>
#include <thread>

#include "mgdd/rig/deadline_grid.hpp"
#include "mgdd/rig/latency_histogram.hpp"
#include "support/test.hpp"

namespace mgdd::rig {
namespace {

constexpr std::int64_t first = 5'000, period = 1'000;

TEST(DeadlineGrid, APunctualLoopMissesNothing) {
  DeadlineGrid grid(first, period);
  for (std::int64_t k = 0; k < 10; ++k) {
    EXPECT_EQ(grid.next_ns(), first + k * period);
    ASSERT_EQ(grid.skip(grid.next_ns() + 30), 0);
    const Turn turn = grid.begin(grid.next_ns() + 30);
    EXPECT_EQ(turn.number, k);
    EXPECT_EQ(turn.deadline_ns, first + k * period);
    EXPECT_EQ(turn.woken_ns, turn.deadline_ns + 30);
    EXPECT_EQ(turn.missed_in_row, 0);
    EXPECT_TRUE(grid.finish(turn.deadline_ns + period));  // exactly at the next one: in time
  }
  EXPECT_EQ(grid.missed(), 0);
  EXPECT_EQ(grid.longest_row(), 0);
}

TEST(DeadlineGrid, AStallSkipsToTheNextGridPointBehindIt) {
  DeadlineGrid grid(first, period);
  ASSERT_EQ(grid.skip(first + 999), 0);    // just not a whole period late
  ASSERT_EQ(grid.skip(first + 1'000), 2);  // 5000 and 6000 are over
  EXPECT_EQ(grid.next_ns(), 7'000);
  EXPECT_EQ(grid.skip(7'100), 0);
  EXPECT_EQ(grid.begin(7'100).number, 2);
  EXPECT_EQ(grid.begin(7'100).missed_in_row, 2);
  EXPECT_EQ(grid.begin(7'100).missed, 2);
  EXPECT_EQ(grid.begin(7'100).skipped, 2);
  EXPECT_TRUE(grid.finish(7'200));
  EXPECT_EQ(grid.begin(8'000).missed_in_row, 0);
  EXPECT_EQ(grid.begin(8'000).missed, 0);
  EXPECT_EQ(grid.missed(), 2);
  EXPECT_EQ(grid.longest_row(), 2);
  EXPECT_EQ(grid.skip(8'000 + 49'999), 50);
  EXPECT_EQ(grid.next_ns(), 58'000);
  EXPECT_EQ(grid.missed(), 52);
}

TEST(DeadlineGrid, TurnsThatTakeTooLongCountInARowWithSkippedOnes) {
  DeadlineGrid grid(first, period);
  EXPECT_FALSE(grid.finish(first + 1'001));
  EXPECT_EQ(grid.skip(first + 1'001), 0);
  EXPECT_EQ(grid.begin(first + 1'001).missed_in_row, 1);
  EXPECT_EQ(grid.begin(first + 1'001).missed, 1);
  EXPECT_EQ(grid.begin(first + 1'001).skipped, 0);
  EXPECT_FALSE(grid.finish(first + 4'300));  // the turn of 6000 ends at 9300
  EXPECT_EQ(grid.skip(first + 4'300), 3);    // 7000, 8000 and 9000 are over
  EXPECT_EQ(grid.next_ns(), 10'000);
  EXPECT_EQ(grid.begin(10'000).missed_in_row, 5);
  EXPECT_EQ(grid.begin(10'000).missed, 4);
  EXPECT_EQ(grid.begin(10'000).skipped, 3);
  EXPECT_TRUE(grid.finish(10'500));
  EXPECT_EQ(grid.missed(), 5);
  EXPECT_EQ(grid.longest_row(), 5);
}

// Whatever happens, every grid point up to the last one is either a turn or missed, and two turns begin on different
// grid points: never a burst.
TEST(DeadlineGrid, EveryGridPointIsATurnOrMissed) {
  std::mt19937_64 random(3);
  std::uniform_int_distribution<std::int64_t> delay(0, 400), rare(0, 30);
  DeadlineGrid grid(first, period);
  std::int64_t now = 0, in_time = 0, last = -1, told = 0;
  for (int k = 0; k < 5'000; ++k) {
    now = std::max(now, grid.next_ns()) + delay(random) * (rare(random) == 0 ? 20 : 1);
    if (grid.skip(now) > 0) continue;
    const Turn turn = grid.begin(now);
    ASSERT_GT(turn.number, last);
    ASSERT_EQ(turn.deadline_ns, first + turn.number * period);
    ASSERT_GE(now, turn.deadline_ns);
    ASSERT_LT(now, turn.deadline_ns + period);
    last = turn.number;
    told += turn.missed;
    now += delay(random) * (rare(random) == 0 ? 9 : 1);
    in_time += grid.finish(now) ? 1 : 0;
  }
  EXPECT_EQ(in_time + grid.missed(), (grid.next_ns() - first) / period);
  EXPECT_EQ(told + grid.begin(now).missed, grid.missed());  // every miss is told to one turn
  EXPECT_GT(grid.missed(), 100);
}

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
