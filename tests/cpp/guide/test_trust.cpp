// Trust in a guide: parabolas with a known optimum along the move, noise, verdicts, and what is learnt of the noise.
#include "mgdd/guide/trust.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/seeker_case.hpp"

namespace mgdd::guide {
namespace {

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
