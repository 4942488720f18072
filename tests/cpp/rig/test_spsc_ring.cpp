// The queue between two threads: order kept, nothing lost or torn, what does not fit is counted.
#include "mgdd/rig/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

#include "mgdd/common/error.hpp"

namespace mgdd::rig {
namespace {

struct Pair {
  std::uint64_t number, square;
};

TEST(SpscRing, KeepsOrderAndCountsWhatDoesNotFit) {
  SpscRing<int> ring(4);
  EXPECT_EQ(ring.capacity(), 4u);
  int value = -1;
  EXPECT_FALSE(ring.pop(value));
  for (int lap = 0; lap < 3; ++lap) {
    for (int i = 0; i < 4; ++i)
      EXPECT_TRUE(ring.push(10 * lap + i));
    EXPECT_FALSE(ring.push(99));
    EXPECT_EQ(ring.size(), 4u);
    for (int i = 0; i < 4; ++i) {
      ASSERT_TRUE(ring.pop(value));
      EXPECT_EQ(value, 10 * lap + i);
    }
    EXPECT_FALSE(ring.pop(value));
  }
  EXPECT_EQ(ring.dropped(), 3u);
  EXPECT_EQ(ring.pushed(), 12u);
}

TEST(SpscRing, RefusesWhatIsNoPowerOfTwo) {
  for (const std::size_t bad : {std::size_t{0}, std::size_t{1}, std::size_t{3}, std::size_t{1000}, largest_ring * 2}) {
    EXPECT_THROW(SpscRing<char>{bad}, ParameterError) << bad;
  }
}

TEST(SpscRing, TwoThreadsLoseAndTearNothing) {
  SpscRing<Pair> ring(8);
  constexpr std::uint64_t n = 50'000;
  std::uint64_t refused = 0, wrong = 0, received = 0;
  std::jthread producer([&] {
    for (std::uint64_t i = 0; i < n;) {
      if (ring.push({i, i * i})) {
        ++i;
      } else {
        ++refused;
        std::this_thread::yield();
      }
    }
  });
  Pair pair{};
  while (received < n) {
    if (!ring.pop(pair)) {
      std::this_thread::yield();
      continue;
    }
    wrong += pair.number == received && pair.square == received * received ? 0u : 1u;
    ++received;
  }
  producer.join();
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(ring.size(), 0u);
  EXPECT_EQ(ring.dropped(), refused);
}

}  // namespace
}  // namespace mgdd::rig
