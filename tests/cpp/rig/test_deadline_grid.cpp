// Deadlines: what is in time, what is late, what is skipped, and that turns never come closer than the grid.
#include "mgdd/rig/deadline_grid.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>

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

}  // namespace
}  // namespace mgdd::rig
