// What a Gaussian process does where cycles fail: beyond an edge of one input, beyond an oblique one, at random.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "support/coupled_map.hpp"

namespace mgdd::optimize {
namespace {

TEST(GaussianProcessSeeking, KeepsOutOfInputsThatFail) {
  const auto s = two_inputs(7);
  GaussianProcessSeeking seeker(s);
  int failed = 0;
  for (int k = 0; k < 200; ++k) {
    const Inputs x = seeker.ask();
    const bool fails = x[1] < 0.22;  // the best input lies in there
    const double j[] = {-lost(x) + noise(7, k)};
    seeker.tell({j, {}, fails});
    if (k >= 100) failed += fails ? 1 : 0;
  }
  EXPECT_LE(failed, 10);
  EXPECT_GE(seeker.estimate()[1], 0.2);
  EXPECT_EQ(seeker.protocol().failures.failing_below().maxCoeff(), -unlimited);  // no edge of one input
}

// Beyond an oblique edge 3 past the best input: edges per input would shut the best one out.
TEST(GaussianProcessSeeking, FindsTheBestInputBesideAnObliqueEdge) {
  int failed = 0, late_failed = 0;
  double late = 0.0;
  constexpr int seeds = 10, cycles = 200;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    for (int k = 0; k < cycles; ++k) {
      const Inputs x = seeker.ask();
      const bool fails = 100.0 * (x[1] - 0.2) - (x[0] + 4.0) > 3.0 * std::sqrt(2.0);
      const double j[] = {-lost(x) + noise(seed, k)};
      seeker.tell({j, {}, fails});
      failed += fails ? 1 : 0;
      late_failed += fails && k >= cycles / 2 ? 1 : 0;
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LT(late, 0.1);
  EXPECT_LE(failed, 8 * seeds);
  EXPECT_LE(late_failed, 2 * seeds);
}

// Cycles that fail at random, wherever they are, fence nothing off.
TEST(GaussianProcessSeeking, FailuresAtRandomKeepItFromNothing) {
  double late = 0.0;
  constexpr int seeds = 10;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    for (int k = 0; k < 200; ++k) {
      const double j[] = {-lost(seeker.ask()) + noise(seed, k)};
      seeker.tell({j, {}, random::uniform(seed, 77, static_cast<std::uint64_t>(k)) < 0.1});
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LT(late, 0.1);
}

}  // namespace
}  // namespace mgdd::optimize
