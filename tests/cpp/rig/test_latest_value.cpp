// The slot of the reference: the reader sees whole values, never an older one after a newer one, and the last in the
// end, while the writer never waits.
#include "mgdd/rig/latest_value.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>

namespace mgdd::rig {
namespace {

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
