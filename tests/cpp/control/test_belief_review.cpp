#include <map>
#include <string_view>

#include "mgdd/common/state.hpp"
#include "mgdd/control/belief_review.hpp"
#include "mgdd/control/friction_learner.hpp"
#include "support/guided_plate.hpp"
#include "support/test.hpp"

namespace mgdd {
namespace {

using namespace control;
using test_support::asymmetric;

constexpr double noise_deg = 0.03;

TEST(BeliefReview, GivesUpABeliefThatPredictsWorseForTheShortTime) {
  BeliefReview<double> review({.worse = 1.5, .roll_back_s = 0.04, .certify_s = 10.0}, 2e-3, noise_deg);
  for (int i = 0; i < 19; ++i)
    EXPECT_EQ(review.judge(0.3, 0.1), Verdict::keep) << i;
  EXPECT_EQ(review.judge(0.3, 0.1), Verdict::roll_back);
  review.restart();
  EXPECT_EQ(review.judge(0.3, 0.1), Verdict::keep) << "it needs the whole time again";
}

TEST(BeliefReview, DifferencesWithinTheNoiseDecideNothing) {
  BeliefReview<double> review({.worse = 1.0, .roll_back_s = 0.02, .certify_s = 10.0}, 1e-3, noise_deg);
  for (int i = 0; i < 500; ++i)
    EXPECT_EQ(review.judge(0.9 * noise_deg, 0.0), Verdict::keep);
}

TEST(BeliefReview, CertifiesWhatPredictsBetterForTheLongTime) {
  BeliefReview<double> review({.worse = 1.5, .roll_back_s = 0.05, .certify_s = 0.4}, 1e-3, noise_deg);
  int samples = 1;
  while (review.judge(0.1, 0.2) == Verdict::keep && samples < 1000)
    ++samples;
  EXPECT_EQ(samples, 400);
  BeliefReview<double> even({.worse = 1.5, .roll_back_s = 0.05, .certify_s = 0.4}, 1e-3, noise_deg);
  for (int i = 0; i < 1000; ++i)
    EXPECT_EQ(even.judge(0.1, 0.12), Verdict::keep) << "a fifth better is not enough";
  even.restart();
  samples = 1;
  while (even.judge(0.1, 0.2) == Verdict::keep && samples < 1000)
    ++samples;
  EXPECT_EQ(samples, 400) << "it needs the whole time again";
}

struct Named {
  std::map<std::string, double> values;
  void operator()(std::string_view name, double value) { values[std::string(name)] = value; }
};

// Sylvester's criterion on what is saved, along slides of random speed and push.
TEST(FrictionLearner, ItsCovarianceStaysPositiveAndBelowTheFirstOne) {
  const GuidedPredictiveSettings s = asymmetric();
  FrictionLearner<float> learner(s.learner, s.plate, 1e-3, noise_deg, 0.35F, 28.0F);
  PlateBelief<float> belief{{0.0F, 0.08F}, {0.0F, 0.08F}, 1.0F, 1.0F};
  std::mt19937_64 generator(5);
  std::uniform_real_distribution<float> speed(-900.0F, 900.0F), push(-0.9F, 0.9F), innovation(-0.5F, 0.5F);
  float v = 0.0F, p = 0.0F;
  double least_gain_variance = s.learner.gain_weight;
  float largest_level = 0.0F;
  for (int k = 0; k < 20000; ++k) {
    if (k % 37 == 0) v = speed(generator), p = push(generator);
    if (k % 211 == 0) learner.forget();
    learner.slide(belief, belief.above, innovation(generator), {p, v, 1.03F});
    Named c;
    FrictionLearner<float>::visit(std::as_const(learner), c);
    const double a = c.values["level_variance"], b = c.values["level_gain"], d = c.values["level_damping"],
                 e = c.values["gain_variance"], f = c.values["gain_damping"], g = c.values["damping_variance"];
    ASSERT_GT(a, 0.0) << k;
    ASSERT_GT(a * e - b * b, 0.0) << k;
    ASSERT_GT(a * (e * g - f * f) - b * (b * g - f * d) + d * (b * f - e * d), 0.0) << k;
    ASSERT_TRUE(learner.is_usable()) << k;
    largest_level = std::max(largest_level, std::abs(belief.above.bias) + belief.above.friction);
    least_gain_variance = std::min(least_gain_variance, e);
  }
  EXPECT_NEAR(largest_level, 0.5F, 1e-6F);  // reached, and never passed
  EXPECT_LT(least_gain_variance, 0.3 * s.learner.gain_weight) << "nothing was narrowed";
  learner.reset();
  Named c;
  FrictionLearner<float>::visit(std::as_const(learner), c);
  EXPECT_EQ(c.values["gain_variance"], s.learner.gain_weight);
}

FrictionLearner<double> learner_of(const GuidedPredictiveSettings& s) {
  return {s.learner, s.plate, 1e-3, noise_deg, 0.35, 28.0};
}

TEST(FrictionLearner, WithoutExcitationWhatItsNumbersHadInCommonFades) {
  const GuidedPredictiveSettings s = asymmetric();
  auto learner = learner_of(s);
  PlateBelief<double> belief{{0.0, 0.08}, {0.0, 0.08}, 1.0, 1.0};
  for (int k = 0; k < 200; ++k)
    learner.slide(belief, belief.above, 0.0, {0.5, 700.0, 1.03});
  const auto common = [&] {
    Named c;
    FrictionLearner<double>::visit(std::as_const(learner), c);
    return c.values["gain_damping"];
  };
  const double before = common();
  EXPECT_GT(std::abs(before), 0.1);
  for (int k = 0; k < 1000; ++k) {  // two memories of a plate whose push is its friction
    learner.forget();
    learner.slide(belief, belief.above, 0.0, {belief.above.bias + belief.above.friction, 1e-6, 1.03});
  }
  EXPECT_NEAR(common() / before, std::exp(-2.0), 0.02);
}

TEST(FrictionLearner, AnInnovationFarBeyondTheNoiseTeachesNoMoreThanTenTimesTheNoise) {
  const GuidedPredictiveSettings s = asymmetric();
  for (const double sign : {1.0, -1.0}) {
    auto one = learner_of(s), other = learner_of(s);
    PlateBelief<double> first{{0.01, 0.08}, {0.0, 0.08}, 1.0, 1.0}, second = first;
    for (int k = 0; k < 20; ++k) {
      one.slide(first, first.above, sign * 10.0 * noise_deg, {0.4, 300.0, 1.03});
      other.slide(second, second.above, sign * 50.0, {0.4, 300.0, 1.03});
    }
    EXPECT_NE(first.above.bias, 0.01);
    EXPECT_EQ(second.above.bias, first.above.bias);
    EXPECT_EQ(second.above.friction, first.above.friction);
    EXPECT_EQ(second.gain_factor, first.gain_factor);
  }
}

// What moved it is not the push: its band lies too far on the side of the motion.
TEST(FrictionLearner, AStuckPlateThatMovesAgainstItsPushShiftsItsBandAgainstTheMotion) {
  auto learner = learner_of(asymmetric());
  FrictionBand<double> up{0.03, 0.08}, down{-0.03, 0.08};
  (void)learner.stick(up, 0.2, 0.15, 0.01);
  (void)learner.stick(down, -0.2, -0.15, -0.01);
  EXPECT_LT(up.bias, 0.03);
  EXPECT_GT(down.bias, -0.03);
  EXPECT_EQ(up.friction, 0.08);
  EXPECT_EQ(up.bias, -down.bias);
}

struct WrongBelief {
  double squared_error;
  std::int64_t rollbacks;
  double gain_factor;
};

// Drives with a belief gone wrong beside a certified one that is right; so slow a learning keeps it.
WrongBelief drive_with_wrong_belief(double rollback_ratio) {
  GuidedPredictiveSettings s = asymmetric();
  s.review.worse = rollback_ratio;
  s.learner.rate_per_s = 0.5;
  GuidedPredictive c(s);
  test_support::Plant plant(s.plate, 30.0);
  const auto driving = [](int k) { return 30.0 + 14.0 * std::sin(0.011 * k); };
  test_support::squared_error(c, plant, 0, 500, driving);
  StateColumns saved = save_state(c);
  saved["gain_factor"] = {0.7};
  saved["bias_above"] = {0.1};
  restore_state(c, saved);
  const double error = test_support::squared_error(c, plant, 500, 1500, driving);
  return {error, c.rollbacks(), c.belief().gain_factor};
}

TEST(GuidedPredictive, ABeliefGoneWrongIsRolledBackToTheCertifiedOne) {
  const WrongBelief with = drive_with_wrong_belief(1.5), without = drive_with_wrong_belief(1e9);
  EXPECT_EQ(with.rollbacks, 1);
  EXPECT_EQ(without.rollbacks, 0);
  EXPECT_NEAR(with.gain_factor, 1.0, 0.05);
  EXPECT_LT(without.gain_factor, 0.8) << "learning alone mended it: nothing to roll back";
  EXPECT_LT(with.squared_error, 0.5 * without.squared_error);
}

TEST(GuidedPredictive, WhatProvesItselfIsCertified) {
  GuidedPredictiveSettings s = asymmetric();
  GuidedPredictive c(s);
  s.plate.friction = 0.05;
  test_support::Plant plant(s.plate, 30.0);
  const auto given = c.certified().above.friction;
  test_support::squared_error(c, plant, 0, 4000, [](int k) { return 40.0 + 15.0 * std::sin(0.012 * k); });
  EXPECT_EQ(given, 0.08);
  EXPECT_NEAR(c.certified().above.friction, 0.05, 0.006);
  EXPECT_EQ(c.rollbacks(), 0);
  c.reset();
  EXPECT_EQ(c.certified().above.friction, 0.08);
}

}  // namespace
}  // namespace mgdd
