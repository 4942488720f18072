// What tests of the feed-forward share: what a guide says, a guided seeker, and cycles on a parabola.
#pragma once

#include "mgdd/guide/feed_forward.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
using namespace optimize;

inline GuideValue at(double optimum, double curvature = bend) {
  return {scalar_input(optimum), scalar_input(curvature)};
}

inline FeedForward<ExtremumSeeking> guided(double start = -20.0, TrustSettings trust = {.noise_sd = 0.25}) {
  ExtremumSeekingSettings s = plain_seeking(start);
  s.space.lower = scalar_input(-30.0);
  s.space.upper = scalar_input(10.0);
  return FeedForward<ExtremumSeeking>(ExtremumSeeking(s), {.trust = trust});
}

/// `cycles` cycles on a parabola with its top at `optimum`; what was applied.
template <class S>
std::vector<double> run(S& seeker, double optimum, int cycles, double noise_sd = 0.0, std::uint64_t seed = 1) {
  std::vector<double> applied;
  for (int k = 0; k < cycles; ++k) {
    const double x = seeker.ask()[0];
    const auto index = static_cast<std::uint64_t>(seeker.protocol().cycle);
    const double j[] = {quadratic(x - optimum) + noise_sd * random::normal(seed, 7, index)};
    EXPECT_EQ(seeker.tell({j, {}, false}), TellStatus::accepted);
    applied.push_back(x);
  }
  return applied;
}

}  // namespace mgdd::guide
