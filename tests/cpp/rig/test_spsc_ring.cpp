// Between two threads: a ring that loses nothing, and the latest value.
#include <atomic>
#include <thread>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/latest_value.hpp"
#include "mgdd/rig/spsc_ring.hpp"
#include "support/test.hpp"

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

using Wide = std::array<std::uint64_t, 9>;  // wider than any atomic

Wide wide(std::uint64_t i) {
  Wide w{};
  for (std::size_t k = 0; k < w.size(); ++k)
    w[k] = i * (k + 1);
  return w;
}

TEST(LatestValue, TheLatestOneWins) {
  LatestValue<double> slot(7.0);
  EXPECT_EQ(slot.read(), 7.0);
  slot.write(1.0);
  EXPECT_EQ(slot.read(), 1.0);
  EXPECT_EQ(slot.read(), 1.0);
  slot.write(2.0);
  slot.write(3.0);
  slot.write(4.0);
  EXPECT_EQ(slot.read(), 4.0);
  EXPECT_EQ(slot.read(), 4.0);
}

TEST(LatestValue, TwoThreadsNeverTearOrGoBack) {
  LatestValue<Wide> slot(wide(0));
  constexpr std::uint64_t n = 100'000;
  std::atomic<bool> seen{false};
  const std::jthread writer([&] {
    for (std::uint64_t i = 1; i <= n; ++i) {
      slot.write(wide(i));
      if (i == n / 2) {
        while (!seen)
          std::this_thread::yield();  // so that both really run at once on one core too
      }
    }
  });
  std::uint64_t last = 0, torn = 0, back = 0;
  while (last < n) {
    const Wide& now = slot.read();
    torn += now == wide(now[0]) ? 0u : 1u;
    back += now[0] < last ? 1u : 0u;
    last = now[0];
    if (last > 0) seen = true;
    if (last < n) std::this_thread::yield();
  }
  EXPECT_EQ(torn, 0u);
  EXPECT_EQ(back, 0u);
}

}  // namespace
}  // namespace mgdd::rig
