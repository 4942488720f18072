// The guided predictive controller on a plate of its own kind: what is learnt, constraints, offset-free laws, preview,
// rest. What a running system needs of it stands in test_guided_predictive_state, throttles in test_guided_throttle.
#include "mgdd/control/guided_predictive.hpp"

#include <span>

#include "support/guided_plate.hpp"
#include "support/test.hpp"

namespace mgdd::control {
namespace {

using namespace test_support;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(GuidedPredictive, LearnsTheLevelsOfEverySideAndDirection) {
  const GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 30.0);
  const PlateBelief<double> truth{{0.03, 0.11}, {-0.02, 0.05}, 1.0, 1.0};
  plant.believe(truth);
  GuidedPredictive controller(s);
  PlateBelief<double> learnt{{0.0, 0.0}, {0.0, 0.0}};
  const auto average = [](FrictionBand<double>& mean, const FrictionBand<double>& now) {
    mean.bias += 0.25 * now.bias;
    mean.friction += 0.25 * now.friction;
  };
  for (int second = 0; second < 6; ++second) {
    squared_error(controller, plant, 1000 * second, 1000 * (second + 1), driving);
    if (second < 2) continue;
    average(learnt.above, controller.belief().above);
    average(learnt.below, controller.belief().below);
  }
  EXPECT_NEAR(learnt.above.bias, 0.03, 0.012);
  EXPECT_NEAR(learnt.above.friction, 0.11, 0.012);
  EXPECT_NEAR(learnt.below.bias, -0.02, 0.012);
  EXPECT_NEAR(learnt.below.friction, 0.05, 0.015);
}

TEST(GuidedPredictive, WhatWasLearntStartsAnotherOne) {
  GuidedPredictiveSettings s = asymmetric();
  const PlateBelief<double> truth{{0.03, 0.12}, {-0.02, 0.05}, 1.15, 0.8};
  Plant warm(s.plate, 30.0);
  warm.believe(truth);
  GuidedPredictive first(s), second(s), cold(s), exact(s);
  squared_error(first, warm, 0, 4000, driving);
  second.set_belief(first.belief());
  exact.set_belief(truth);
  const auto small_step = [](int k) { return k < 300 ? 40.0 : 42.0; };
  const auto run = [&](GuidedPredictive& controller) {
    Plant plant(s.plate, 40.0);
    plant.believe(truth);
    squared_error(controller, plant, 0, 300, small_step);
    return squared_error(controller, plant, 300, 800, small_step);
  };
  const double warm_error = run(second);
  EXPECT_LT(warm_error, 1.2 * run(exact));
  EXPECT_LT(warm_error, 0.97 * run(cold));
}

TEST(GuidedPredictive, APlainOneIsOffsetFreeByItsBias) {
  GuidedPredictiveSettings s = plain();
  s.plate.friction = 0.0;
  for (const double disturbance : {0.0, -0.065}) {
    Plant plant(s.plate, 20.0);
    GuidedPredictive controller(s);
    std::vector<double> errors;
    for (int k = 0; k < 2500; ++k) {
      plant.step(controller.step(k < 500 ? 20.0 : 60.0, plant.angle_deg()), disturbance);
      errors.push_back(std::abs(60.0 - plant.angle_deg()));
    }
    EXPECT_LT(errors[1100], 2e-3) << disturbance;
    EXPECT_LT(errors[2499], 1e-5) << disturbance;
  }
}

TEST(GuidedPredictive, OneGaussNewtonStepIsEnoughAndRefiningConverges) {
  const GuidedPredictiveSettings once = plain();
  GuidedPredictiveSettings often = once;
  often.gauss_newton_steps = 10;
  Plant a(once.plate, 25.0), b(once.plate, 25.0);
  GuidedPredictive quick(once), converged(often);
  const auto reference = [](int k) { return k < 300 ? 25.0 : k < 700 ? 5.0 : 45.0; };
  const double first = squared_error(quick, a, 0, 1200, reference);
  const double second = squared_error(converged, b, 0, 1200, reference);
  EXPECT_NEAR(second, first, 0.02 * first);
  // Refining after the step leads to the same duty as more steps inside it.
  GuidedPredictive refined(once), direct(often);
  const double y = 12.0;
  refined.take_over(y, 0.15);
  direct.take_over(y, 0.15);
  refined.step(40.0, y);
  direct.step(40.0, y);
  for (int i = 0; i < 40; ++i)
    refined.refine();
  for (int i = 0; i < 4; ++i)
    direct.refine();
  EXPECT_NEAR(refined.duty(), direct.duty(), 2e-3);
}

TEST(GuidedPredictive, ALinearPredictionIsSolvedInOneStep) {
  GuidedPredictiveSettings s = plain();
  s.prediction = Prediction::linear;
  Plant plant(s.plate, 30.0);
  GuidedPredictive controller(s);
  for (int k = 0; k < 300; ++k) {
    const double duty = controller.step(30.0 + 6.0 * std::sin(0.02 * k), plant.angle_deg());
    if (k % 20 == 19) {
      GuidedPredictive again = controller;
      EXPECT_NEAR(again.refine(), duty, 2e-4) << k;  // but for the damping of 0.1 %
    }
    plant.step(duty);
  }
}

TEST(GuidedPredictive, DutyAndItsRateStayInsideTheirBounds) {
  GuidedPredictiveSettings s = asymmetric();
  s.duty.lower = -0.7;
  s.duty.upper = 0.55;
  s.duty_rate_per_s = 40.0;
  for (const bool learning : {true, false}) {
    s.friction_learning = learning;
    Plant plant(s.plate, 20.0);
    GuidedPredictive controller(s);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> anywhere(-30.0, 120.0);
    double reference = 20.0, last = nan;
    int at_the_rate = 0;
    for (int k = 0; k < 8000; ++k) {
      if (k % 37 == 0) reference = anywhere(random);
      const double duty = controller.step(reference, k % 101 == 0 ? nan : plant.angle_deg());
      ASSERT_GE(duty, -0.7);
      ASSERT_LE(duty, 0.55);
      if (std::isfinite(last)) {
        ASSERT_LE(std::abs(duty - last), 0.04 + 1e-12);
        at_the_rate += std::abs(duty - last) > 0.0399;
      }
      last = duty;
      plant.step(duty);
    }
    EXPECT_GT(at_the_rate, 150);
  }
}

TEST(GuidedPredictive, ABoundOfTheAngleIsWeighedAgainstTheError) {
  GuidedPredictiveSettings s = plain();
  s.plate.friction = 0.0;
  s.highest_deg = 50.0;
  s.angle_limit_weight = 19.0;
  Plant plant(s.plate, 30.0);
  GuidedPredictive controller(s);
  for (int k = 0; k < 3000; ++k)
    plant.step(controller.step(60.0, plant.angle_deg()));
  EXPECT_NEAR(plant.angle_deg(), 50.5, 0.01);  // least (60 - y)² + 19 (y - 50)²
}

TEST(GuidedPredictive, APreviewIsBetterThanTheRateAlone) {
  const auto reference = [](int k) { return k < 300 ? 20.0 : 24.0; };
  const auto run = [&](bool sees) {
    Plant plant(asymmetric().plate, 20.0);
    GuidedPredictive controller(asymmetric());
    double sum = 0.0;
    for (int k = 0; k < 600; ++k) {
      std::vector<double> ahead;
      for (int i = 1; i <= 50 && sees; ++i)
        ahead.push_back(reference(k + i));
      plant.step(controller.step(reference(k), plant.angle_deg(), ahead));
      const double error = reference(k + 1) - plant.angle_deg();
      sum += error * error;
    }
    return sum;
  };
  EXPECT_LT(run(true), 0.6 * run(false));
}

TEST(GuidedPredictive, AStuckPlateIsFreedAndAHeldOneIsLeftAlone) {
  const GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 40.0);
  GuidedPredictive controller(s);
  const auto settle = [&](double reference, int samples) {
    double variation = 0.0, last = controller.duty();
    for (int k = 0; k < samples; ++k) {
      const double duty = controller.step(reference, plant.angle_deg());
      variation += std::abs(duty - last);
      last = duty;
      plant.step(duty);
    }
    return variation;
  };
  settle(40.0, 300);
  settle(40.4, 100);
  EXPECT_NEAR(plant.angle_deg(), 40.4, 0.13);
  settle(40.4, 500);
  EXPECT_TRUE(controller.holds());
  EXPECT_LT(settle(40.4, 1000), 1e-9);
}

TEST(GuidedPredictive, ASlowPlateSaysNothingAboutGainAndDamping) {
  const GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 40.0);
  plant.believe({{0.01, 0.09}, {0.0, 0.08}, 1.0, 1.0});
  GuidedPredictive controller(s);
  std::mt19937_64 random(8);
  std::normal_distribution<double> noise(0.0, 0.03);
  for (int k = 0; k < 30000; ++k)
    plant.step(controller.step(40.0 + 12.0 * std::sin(6e-3 * k), plant.angle_deg() + noise(random)));
  EXPECT_NEAR(controller.belief().gain_factor, 1.0, 0.06);
  EXPECT_NEAR(controller.belief().damping_factor, 1.0, 0.06);
  EXPECT_NEAR(controller.belief().above.friction, 0.09, 0.02);
}

TEST(GuidedPredictive, NothingIsLearntAtAStop) {
  for (const auto& [end, out, duty] : {std::array{90.0, 1.0, 0.19}, std::array{0.0, -1.0, -0.17}}) {
    GuidedPredictive controller(asymmetric());
    controller.take_over(end, duty);
    for (int k = 0; k < 400; ++k)  // the stop gives way and creeps back, which no friction explains
      controller.step(end, end + out * (0.3 - 1e-4 * k));
    for (const auto* band : {&controller.belief().above, &controller.belief().below}) {
      EXPECT_EQ(band->friction, 0.08);
      EXPECT_EQ(band->bias, 0.0);
    }
    EXPECT_EQ(controller.belief().gain_factor, 1.0);
  }
}

TEST(GuidedPredictive, APlateAtItsStopIsNotPressedOn) {
  const GuidedPredictiveSettings s = asymmetric();
  for (const double end : {s.plate.closed_deg, s.plate.open_deg}) {
    Plant plant(s.plate, 45.0);
    GuidedPredictive controller(s);
    int arrived = -1, released = -1;
    for (int k = 0; k < 400; ++k) {
      const double duty = controller.step(k < 50 ? 45.0 : end, plant.angle_deg());
      plant.step(duty);
      if (arrived < 0 && std::abs(plant.angle_deg() - end) < 0.01) arrived = k;
      if (std::abs(duty) > 0.4) released = k + 1;
    }
    ASSERT_GT(arrived, 50);
    EXPECT_LT(released - arrived, 60) << end;
    EXPECT_NEAR(plant.angle_deg(), end, 0.01);
  }
}

TEST(GuidedPredictive, TheModelIsToldTheDutyThatTheRateAllowed) {
  GuidedPredictiveSettings s = asymmetric();
  s.duty_rate_per_s = 3.0;
  Plant plant(s.plate, 20.0);
  GuidedPredictive controller(s);
  double worst = 0.0;
  for (int k = 0; k < 4000; ++k) {  // small steps: the duty that frees the plate is far away
    plant.step(controller.step(k / 200 % 2 == 0 ? 20.0 : 21.0, plant.angle_deg()));
    worst = std::max(worst, std::abs(controller.innovation_deg()));
  }
  EXPECT_LT(worst, 0.03);
}

TEST(GuidedPredictive, APreviewIsReadAtItsOwnTime) {
  const GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 40.0);
  GuidedPredictive controller(s);
  const auto reference = [](int k) { return 40.0 + 10.0 * std::sin(0.0126 * k); };
  double sum = 0.0;
  for (int k = 0; k < 2000; ++k) {
    std::vector<double> ahead;
    for (int i = 1; i <= 50; ++i)
      ahead.push_back(reference(k + i));
    plant.step(controller.step(reference(k), plant.angle_deg(), ahead));
    if (k >= 500) sum += std::pow(reference(k + 1) - plant.angle_deg(), 2);
  }
  EXPECT_LT(std::sqrt(sum / 1500.0), 0.12);  // 1 ms is 0.09 deg rms
}

TEST(FrictionLearner, APlateThatMovesAgainstItsLevelLowersItToWhatPushed) {
  const GuidedPredictiveSettings s = asymmetric();
  FrictionLearner<double> learner(s.learner, s.plate, 1e-3, 0.03, 0.35, 28.0);
  FrictionBand<double> band{0.0, 0.08};
  EXPECT_EQ(learner.stick(band, 0.2, 0.05, 0.05), 0.0);  // once may be noise
  EXPECT_EQ(band.friction, 0.08);
  EXPECT_NEAR(learner.stick(band, 0.2, 0.15, 0.05), 40.0, 1e-12);
  EXPECT_NEAR(band.bias + band.friction, 0.045, 1e-12);
  EXPECT_NEAR(band.bias - band.friction, -0.08, 1e-12);  // of closing, untouched
  FrictionBand<double> other{0.0, 0.08};
  EXPECT_NEAR(learner.stick(other, -0.2, -0.15, -0.05), -40.0, 1e-12);
  EXPECT_NEAR(other.bias - other.friction, -0.045, 1e-12);
  EXPECT_NEAR(other.bias + other.friction, 0.08, 1e-12);
}

}  // namespace
}  // namespace mgdd::control
