// Feed-forward with a learnt trim: whole moves at a new point, no bump at a calibration, guides that cannot be used.
#include "mgdd/guide/feed_forward.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "mgdd/optimize/ask_tell/variant_seeker.hpp"
#include "support/guided_case.hpp"

namespace mgdd::guide {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(FeedForward, ALittleTrustedGuideIsInForceInPart) {
  FeedForward<ExtremumSeeking> seeker = guided(-20.0, {.initial = 0.25, .noise_sd = 0.25});
  seeker.offer(at(-4.0), GuideCause::calibration);
  EXPECT_EQ(seeker.estimate()[0], -20.0);
  EXPECT_NEAR(seeker.path().feed_forward()[0], -16.0, 1e-12);
}

// The guide is 1.5 CAD late everywhere: the trim takes that, and a step moves the estimate as far as the optimum goes.
TEST(FeedForward, ANewPointMovesTheEstimateAndKeepsTheTrim) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-2.7), GuideCause::new_point);
  run(seeker, -4.2, 600);
  const double trim = seeker.trim()[0];
  EXPECT_NEAR(trim, -1.5, 0.02);
  seeker.offer(at(-9.2), GuideCause::new_point);
  const std::vector<double> applied = run(seeker, -10.7, 2);
  EXPECT_NEAR(applied[0], -4.2, 0.02);   // the test of the guide: the old place, without dither ...
  EXPECT_NEAR(applied[1], -10.7, 0.02);  // ... and the new one
  EXPECT_EQ(seeker.path().trust().verdict(), Verdict::confirmed);
  EXPECT_NEAR(seeker.estimate()[0], -10.7, 0.05);
  EXPECT_NEAR(seeker.trim()[0], trim, 1e-12);
}

TEST(FeedForward, WhatIsLeftOfACalibrationBelongsToTheOldPoint) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-1.0), GuideCause::new_point);
  run(seeker, -1.0, 300);
  seeker.offer(at(-4.0), GuideCause::calibration);
  seeker.offer(at(-7.0), GuideCause::new_point);  // by the new model the optimum moves by 3 CAD, not by 6
  run(seeker, -4.0, 2);
  EXPECT_NEAR(seeker.estimate()[0], -4.0, 0.1);
  EXPECT_NEAR(seeker.path().feed_forward()[0], -7.0, 0.1);
}

TEST(FeedForward, FollowsAPointThatDriftsThroughAFilterWithoutATestOrARestart) {
  FeedForward<ExtremumSeeking> plain = guided(), drifting = guided();
  for (FeedForward<ExtremumSeeking>* one : {&plain, &drifting}) {
    one->offer(at(-4.0), GuideCause::new_point);
    run(*one, -4.0, 45);
  }
  drifting.offer(at(-4.3), GuideCause::following);
  double left = 0.3;
  for (int k = 0; k < 120; ++k) {
    left *= 0.8;
    const double shift = -(0.3 - left);
    drifting.ask();
    EXPECT_NEAR(drifting.path().feed_forward()[0], -4.0 + shift, 1e-8);
    const double x = plain.ask()[0];
    EXPECT_NEAR(drifting.ask()[0], x + shift, 1e-8);  // asking again moves nothing
    const double j[] = {quadratic(x + 4.0)};
    plain.tell({j, {}, false});
    drifting.tell({j, {}, false});
    EXPECT_FALSE(drifting.path().testing());
  }
  EXPECT_EQ(drifting.path().feed_forward()[0], -4.3);
  EXPECT_EQ(save_state(drifting.seeker()).at("seen"), save_state(plain.seeker()).at("seen"));
  drifting.offer(at(-4.6), GuideCause::following);
  run(drifting, -4.3, 1);
  drifting.offer(at(-9.0), GuideCause::new_point);  // what was not yet followed belongs to the move
  const double before = drifting.estimate()[0];
  run(drifting, before - 4.64, 2);
  EXPECT_NEAR(drifting.estimate()[0] - before, -(9.0 - 4.36), 0.1);
}

TEST(FeedForward, AskTellAndOfferAreNoexceptAndDoNotAllocate) {
  for (auto& [name, any] : every_seeker(space_at(scalar_input(8.0), 40.0), 0.25, 3)) {
    SCOPED_TRACE(name);
    FeedForward<VariantSeeker> seeker{VariantSeeker(any)};
    const GuideValue one = at(2.0), other = at(-6.0), bad = at(nan);
    static_assert(noexcept(seeker.ask()) && noexcept(seeker.restart()) &&
                  noexcept(seeker.tell(std::declval<const Reading&>())) &&
                  noexcept(seeker.offer(one, GuideCause::new_point)));
    static_assert(AnySeeker<FeedForward<VariantSeeker>>);
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 600; ++k) {
      if (k % 60 == 0) seeker.offer(k % 120 == 0 ? one : other, GuideCause::new_point);
      if (k % 60 == 30) seeker.offer(k % 120 == 30 ? bad : other, GuideCause::calibration);
      const double j[] = {quadratic(seeker.ask()[0]) + 0.1 * std::sin(k)};
      seeker.tell({j, {}, k % 50 == 7});
    }
    EXPECT_EQ(counter.count(), 0u);
  }
}

}  // namespace
}  // namespace mgdd::guide
