// Tests of a guide, and the trust that they leave.
#include "mgdd/guide/feed_forward.hpp"
#include "mgdd/guide/trust.hpp"
#include "support/guided_case.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

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

using optimize::Inputs;

Trust known_noise(double noise_sd, double initial = 1.0, int probe_cycles = 1) {
  return {{.initial = initial, .probe_cycles = probe_cycles, .noise_sd = noise_sd}, 1};
}

/// J at the share b less J at 0 of a parabola of bend K whose optimum lies at the share a.
double rise_of(double bend, double optimum, double tried) {
  return -0.5 * bend * ((tried - optimum) * (tried - optimum) - optimum * optimum);
}

TEST(Trust, IsTheShareOfTheMoveWhereTheOptimumLies) {
  const double bend = 0.051 * 6.5 * 6.5;
  for (const double optimum : {-1.0, -0.2, 0.0, 0.3, 0.65, 1.0, 1.4}) {
    for (const double tried : {0.4, 1.0}) {
      Trust trust({.curvature_spread = 0.0, .noise_sd = 1e-7}, 1);
      EXPECT_NEAR(trust.judge(rise_of(bend, optimum, tried), 0.0, tried, bend), std::clamp(optimum, 0.0, 1.0), 1e-5)
          << optimum << " at " << tried;
    }
  }
}

TEST(Trust, ReadsTheSameShareFromWhateverTwoPlacesThePlantApplied) {
  const double bend = 2.0, optimum = 0.4;
  for (const auto& [old, tried] : {std::pair{0.0, 1.0}, {0.1, 0.7}, {-0.2, 0.5}}) {
    Trust trust({.curvature_spread = 0.0, .noise_sd = 1e-7}, 1);
    const double rise = rise_of(bend, optimum, tried) - rise_of(bend, optimum, old);
    EXPECT_NEAR(trust.judge(rise, old, tried, bend), optimum, 1e-5) << old << " " << tried;
  }
  Trust stuck = known_noise(0.1, 0.7);
  EXPECT_EQ(stuck.judge(-5.0, 0.3, 0.3, bend), 0.7);
  EXPECT_EQ(stuck.verdict(), Verdict::untested);
}

TEST(Trust, WeighsTheMeasurementByItsErrorAgainstWhatWasBelieved) {
  const double bend = 2.0, tried = 0.8, optimum = 0.25;
  double before = 0.0;
  for (const double noise : {1e-6, 0.1, 0.3, 1.0, 3.0, 1e3}) {
    Trust trust = known_noise(noise);
    const double share = trust.judge(rise_of(bend, optimum, tried), 0.0, tried, bend);
    EXPECT_GT(share, before) << noise;  // from what was measured to what was believed
    EXPECT_EQ(share, trust.value());
    before = share;
  }
  EXPECT_NEAR(before, 1.0, 1e-3);
  Trust once = known_noise(0.8), often = known_noise(0.8, 1.0, 16);
  EXPECT_GT(once.judge(rise_of(bend, optimum, tried), 0.0, tried, bend),
            often.judge(rise_of(bend, optimum, tried), 0.0, tried, bend));
}

TEST(Trust, SaysWrongOnlyWhereJFellByMoreThanTheNoise) {
  const double error = 0.25 * std::sqrt(2.0);
  for (const double bend : {2.0, 0.0}) {
    const auto verdict = [&](double rise) {
      Trust trust = known_noise(0.25);
      EXPECT_EQ(trust.verdict(), Verdict::untested);
      trust.judge(rise, 0.0, 1.0, bend);
      return trust.verdict();
    };
    EXPECT_EQ(verdict(-3.01 * error), Verdict::wrong);
    EXPECT_EQ(verdict(-2.99 * error), Verdict::undecided);
    EXPECT_EQ(verdict(2.99 * error), Verdict::undecided);
    EXPECT_EQ(verdict(3.01 * error), Verdict::confirmed);
  }
}

TEST(Trust, WithoutACurvatureGoesByTheVerdictAlone) {
  Trust trust = known_noise(0.1, 0.6);
  EXPECT_EQ(trust.judge(-5.0, 0.0, 1.0, 0.0), 0.0);  // the move is not taken
  EXPECT_NEAR(trust.value(), 0.3, 1e-12);
  EXPECT_NEAR(trust.judge(5.0, 0.0, 1.0, 0.0), 0.65, 1e-12);
  EXPECT_NEAR(trust.judge(0.0, 0.0, 1.0, 0.0), 0.65, 1e-12);
  trust.refuse();
  EXPECT_LT(trust.value(), 0.65);
}

TEST(Trust, TestsWhatTheNoiseDoesNotHide) {
  const double error = 0.25 * std::sqrt(2.0);
  const Trust full = known_noise(0.25), none = known_noise(0.25, 0.0);
  EXPECT_EQ(full.trial_share(0.9 * error), 0.0);
  EXPECT_EQ(full.trial_share(1.1 * error), 1.0);
  EXPECT_NEAR(none.trial_share(8.0 * error), 0.25, 1e-12);  // small and cheap, but large enough to show something
  EXPECT_EQ(full.trial_share(0.0), 1.0);
  EXPECT_EQ(Trust({.probe_cycles = 0, .noise_sd = 0.25}, 1).trial_share(100.0), 0.0);
  EXPECT_EQ(Trust({}, 1).trial_share(100.0), 0.0);  // the noise is not known yet
}

TEST(Trust, LearnsTheNoiseBesideTheSearch) {
  double mean = 0.0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Trust trust({}, 2);
    EXPECT_TRUE(std::isnan(trust.noise_sd()));
    for (int k = 0; k < 120; ++k) {
      const Inputs x = optimize::inputs({std::sin(0.6 * k) - 0.02 * k, std::sin(1.3 * k)});
      trust.record(x, 50.0 + 0.3 * x[0] - 0.8 * x[1] + 0.25 * random::normal(seed, 2, static_cast<std::uint64_t>(k)));
      if (k == 60) trust.forget();
      if (k == 61) {
        EXPECT_GT(trust.noise_sd(), 0.1);  // a new operating point does not change the sensor
      }
    }
    mean += trust.noise_sd() / 40.0;
  }
  EXPECT_NEAR(mean, 0.25, 0.02);
}

TEST(Trust, LearnsTheNoiseFromFewReadingsWithoutABias) {
  double variance = 0.0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    Trust trust({}, 2);
    for (int k = 0; k < 12; ++k) {
      trust.record(optimize::inputs({std::sin(0.6 * k), std::cos(1.3 * k)}),
                   0.25 * random::normal(seed, 2, static_cast<std::uint64_t>(k)));
    }
    variance += trust.noise_sd() * trust.noise_sd() / 2000.0;
  }
  EXPECT_NEAR(std::sqrt(variance), 0.25, 0.01);
}

}  // namespace
}  // namespace mgdd::guide
