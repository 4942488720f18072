// The test of a guide within a feed-forward: guides that are wrong and get better, limits, bounds, clamps, misfires,
// wild readings, and a test that is cut short.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mgdd/guide/feed_forward.hpp"
#include "support/guided_case.hpp"

namespace mgdd::guide {
namespace {

TEST(FeedForward, TurnsDownAGuideThatGoesTheWrongWay) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-4.2), GuideCause::new_point);
  run(seeker, -4.2, 300, 0.25);
  const double before = seeker.estimate()[0];
  seeker.offer(at(2.3), GuideCause::new_point);
  run(seeker, -10.7, 2, 0.25);
  EXPECT_EQ(seeker.path().trust().verdict(), Verdict::wrong);
  EXPECT_LT(seeker.path().trust().value(), 0.1);
  EXPECT_NEAR(seeker.estimate()[0], before, 0.6);
  seeker.offer(at(-4.2), GuideCause::new_point);  // back at the first point the guide has to earn its trust anew
  const std::vector<double> applied = run(seeker, -4.2, 2, 0.25);
  EXPECT_LT(std::abs(applied[1] - applied[0]), 0.6 * 6.5);
}

TEST(FeedForward, AGuideThatWasTurnedDownEarnsItsTrustBack) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-4.2), GuideCause::new_point);
  run(seeker, -4.2, 300, 0.25);
  seeker.offer(at(2.3), GuideCause::new_point);
  run(seeker, -10.7, 300, 0.25);
  const double turned_down = seeker.path().trust().value();
  ASSERT_LT(turned_down, 0.1);
  for (int k = 0; k < 12; ++k) {  // from now on it is right about every move
    const double optimum = k % 2 == 0 ? -4.2 : -10.7;
    seeker.offer(at(k % 2 == 0 ? 8.8 : 2.3), GuideCause::new_point);
    run(seeker, optimum, 150, 0.25);
    EXPECT_NEAR(seeker.estimate()[0], optimum, 3.0);
  }
  EXPECT_GT(seeker.path().trust().value(), 0.7);
}

TEST(FeedForward, ANewPointDuringATestLeavesNothingBehind) {
  for (const int cycles : {0, 1}) {
    FeedForward<ExtremumSeeking> seeker = guided();
    seeker.offer(at(-4.2), GuideCause::new_point);
    run(seeker, -4.2, 100, 0.25);
    const double estimate = seeker.estimate()[0];
    seeker.offer(at(-10.7), GuideCause::new_point);
    run(seeker, -10.7, cycles, 0.25);
    EXPECT_TRUE(seeker.path().testing());
    seeker.offer(at(-4.2), GuideCause::new_point);
    EXPECT_FALSE(seeker.path().testing());
    EXPECT_NEAR(seeker.estimate()[0], estimate, 1e-12);
    EXPECT_NEAR(seeker.path().feed_forward()[0], -4.2, 1e-12);
    seeker.offer(at(-10.7), GuideCause::new_point);
    seeker.offer(at(-13.0), GuideCause::new_point);  // on to a third point: the whole way from the first one
    run(seeker, -13.0, 2);
    EXPECT_NEAR(seeker.estimate()[0], estimate - 8.8, 0.6);
  }
}

TEST(FeedForward, OneWildReadingDoesNotOverthrowAGuide) {
  for (const double wild : {-50.0, 50.0}) {
    FeedForward<ExtremumSeeking> seeker = guided();
    seeker.offer(at(-4.2), GuideCause::new_point);
    seeker.offer(at(-10.7), GuideCause::new_point);
    run(seeker, -10.7, 1);
    const double j[] = {quadratic(seeker.ask()[0] + 10.7) + wild};
    seeker.tell({j, {}, false});
    EXPECT_GT(seeker.path().trust().value(), 0.7) << wild;
  }
}

// The optimum moves by 0.6 of what the guide says, there and back: the move is made so far, and so is the next one.
TEST(FeedForward, MakesTheShareOfTheMoveThatTheMeasurementsConfirm) {
  FeedForward<ExtremumSeeking> seeker = guided(-20.0, {.curvature_spread = 0.0, .noise_sd = 0.01});
  seeker.offer(at(-4.0), GuideCause::new_point);
  run(seeker, -4.0, 103);
  double before = seeker.estimate()[0];
  for (const bool there : {true, false, true}) {
    seeker.offer(at(there ? -14.0 : -4.0), GuideCause::new_point);
    EXPECT_EQ(save_state(seeker.seeker()).at("seen")[0], 0.0);
    run(seeker, there ? -10.0 : -4.0, 2);
    EXPECT_NEAR(seeker.path().trust().value(), 0.6, 0.02);
    EXPECT_NEAR(seeker.estimate()[0] - before, there ? -6.0 : 6.0, 0.3);
    before = seeker.estimate()[0];
  }
  EXPECT_NEAR(seeker.path().feed_forward()[0] + seeker.trim()[0], before, 1e-12);
}

TEST(FeedForward, AMoveThatBreaksALimitIsNotTakenButOneThatLessensABrokenOneIs) {
  for (const bool breaks : {true, false}) {
    const double from = breaks ? -4.0 : -12.0, to = breaks ? -12.0 : -4.0;
    ExtremumSeekingSettings s = plain_seeking(from);
    s.limits = {{"p_max_bar", 150.0}};
    FeedForward<ExtremumSeeking> seeker(ExtremumSeeking(s), {.trust = {.noise_sd = 0.25}});
    seeker.offer(at(from), GuideCause::new_point);
    seeker.offer(at(to), GuideCause::new_point);
    for (int k = 0; k < 2; ++k) {
      const double x = seeker.ask()[0];
      const double j[] = {quadratic(x - to)}, pressure[] = {breaks ? 140.0 - 2.0 * (x + 4.0) : 155.0 - 0.5 * (x + 4.0)};
      seeker.tell({j, pressure, false});
    }
    EXPECT_EQ(seeker.path().trust().verdict(), breaks ? Verdict::wrong : Verdict::confirmed);
    EXPECT_NEAR(seeker.estimate()[0], -4.0, breaks ? 0.0 : 0.5);
  }
}

TEST(FeedForward, TestsNoFurtherThanTheLowerBound) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-20.0), GuideCause::new_point);
  seeker.shift_estimate(scalar_input(-5.0));
  seeker.offer(at(-29.0), GuideCause::new_point);
  EXPECT_NEAR(run(seeker, -29.0, 2)[1], -30.0, 1e-12);
}

TEST(FeedForward, TestsWithinTheBoundsAndAfterTheSensorHasSettled) {
  FeedForward<ExtremumSeeking> seeker = guided(-20.0, {.probe_cycles = 2, .probe_settling = 3, .noise_sd = 0.25});
  seeker.offer(at(4.0), GuideCause::new_point);
  seeker.shift_estimate(scalar_input(2.0));
  seeker.offer(at(9.9), GuideCause::new_point);
  const std::vector<double> applied = run(seeker, 9.0, 10);
  for (int k = 0; k < 10; ++k)
    EXPECT_NEAR(applied[static_cast<std::size_t>(k)], k < 5 ? 6.0 : 10.0, 1e-12) << k;
  EXPECT_FALSE(seeker.path().testing());
}

TEST(FeedForward, AMisfiredCycleOfATestIsMeasuredAgain) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-4.2), GuideCause::new_point);
  seeker.offer(at(-10.7), GuideCause::new_point);
  for (const bool misfire : {true, false, true, true}) {
    EXPECT_TRUE(seeker.path().testing());
    const double x = seeker.ask()[0];
    const double j[] = {quadratic(x + 10.7)};
    seeker.tell({j, {}, misfire});
  }
  EXPECT_TRUE(seeker.path().at_trial());
  run(seeker, -10.7, 1);
  EXPECT_FALSE(seeker.path().testing());
  EXPECT_NEAR(seeker.estimate()[0], -10.7, 0.1);
}

}  // namespace
}  // namespace mgdd::guide
