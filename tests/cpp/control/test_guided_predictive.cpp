// The guided predictive controller on a plate of its own kind: what is learnt, constraints, offset-free laws, preview,
// bad input, both scalars, a restart bit for bit, no allocation. The virtual throttle stands in test_throttle_control.
#include "mgdd/control/guided_predictive.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::control {
namespace {

static_assert(noexcept(std::declval<GuidedPredictive&>().step(0.0, 0.0)));
static_assert(noexcept(std::declval<BasicGuidedPredictive<float>&>().step(0.0F, 0.0F)));
static_assert(noexcept(std::declval<GuidedPredictive&>().prepare()) &&
              noexcept(std::declval<GuidedPredictive&>().refine()));

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

GuidedPredictiveSettings asymmetric() {
  GuidedPredictiveSettings s;
  s.plate.spring = {.limp_home_deg = 11.0, .ramp_deg = 0.5, .above = {0.12, 7e-4}, .below = {0.16, 1.1e-3}};
  s.plate.friction = 0.08;
  return s;
}

/// The plain form without integral: what the model does not explain, its one bias must.
GuidedPredictiveSettings plain() {
  GuidedPredictiveSettings s = asymmetric();
  s.friction_learning = false;
  s.trim_rate_per_deg_s = 0.0;
  s.duty_change_weight = 20.0;
  s.move_steps = {4, 6, 10};
  return s;
}

/// A plate of the kind that the controller believes in, with steps of 0.1 ms and one sample of delay.
class Plant {
 public:
  Plant(const PlateSettings& settings, double angle_deg) : model_(settings, 1e-4, PlateFriction::set_valued) {
    state_ = model_.at_rest(angle_deg, model_.holding(angle_deg));
    acting_ = state_.torque;
  }
  void believe(const PlateBelief<double>& belief) { model_.believe(belief); }
  double step(double duty, double disturbance = 0.0) {
    for (int i = 0; i < 10; ++i)
      model_.step(state_, acting_ + disturbance);
    acting_ = duty;
    return state_.angle_deg;
  }
  double angle_deg() const { return state_.angle_deg; }

 private:
  PlateModel<double> model_;
  PlateState<double> state_;
  double acting_;
};

template <class Controller, class Reference>
double squared_error(Controller& controller, Plant& plant, int from, int to, Reference reference) {
  double sum = 0.0;
  for (int k = from; k < to; ++k) {
    const double duty = controller.step(reference(k), plant.angle_deg());
    plant.step(duty);
    const double error = reference(k) - plant.angle_deg();
    sum += error * error;
  }
  return sum;
}

double driving(int k) {
  const double t = 1e-3 * k;
  const double slow = 35.0 + 22.0 * std::sin(5.0 * t) + 6.0 * std::sin(17.0 * t);
  return k % 400 < 200 ? slow : 5.0 + 3.5 * std::sin(11.0 * t);
}

TEST(GuidedPredictive, LearnsTheLevelsOfEverySideAndDirection) {
  GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 30.0);
  const PlateBelief<double> truth{{0.03, 0.11}, {-0.02, 0.05}, 1.0, 1.0};
  plant.believe(truth);
  GuidedPredictive controller(s);
  squared_error(controller, plant, 0, 6000, driving);
  const PlateBelief<double>& learnt = controller.belief();
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

TEST(GuidedPredictive, MoreGaussNewtonStepsNeverRaiseTheGuardedPerformance) {
  GuidedPredictiveSettings once = plain(), often = plain();
  often.gauss_newton_steps = 10;
  Plant a(once.plate, 25.0), b(once.plate, 25.0);
  GuidedPredictive quick(once), converged(often);
  const auto reference = [](int k) { return k < 300 ? 25.0 : k < 700 ? 5.0 : 45.0; };
  const double first = squared_error(quick, a, 0, 1200, reference);
  const double second = squared_error(converged, b, 0, 1200, reference);
  EXPECT_NEAR(second, first, 0.02 * first);  // one step is enough
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
  s.lower = -0.7;
  s.upper = 0.55;
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
  GuidedPredictiveSettings s = asymmetric();
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

TEST(GuidedPredictive, BadInputRepeatsTheReferenceOrCorrectsNothing) {
  GuidedPredictive controller(asymmetric());
  EXPECT_EQ(controller.step(nan, nan), 0.0);
  EXPECT_EQ(controller.step(30.0, nan), 0.0);
  GuidedPredictive same(asymmetric());
  same.step(30.0, 20.0);
  GuidedPredictive other = same;
  EXPECT_EQ(same.step(nan, 20.5), other.step(30.0, 20.5));
  for (int k = 0; k < 20; ++k) {
    EXPECT_TRUE(std::isfinite(same.step(30.0, nan)));
    EXPECT_TRUE(std::isfinite(same.step(std::numeric_limits<double>::infinity(), 21.0)));
  }
  same.take_over(nan, 0.2);
  EXPECT_NE(same.duty(), 0.2);
  same.take_over(25.0, 0.2);
  EXPECT_EQ(same.duty(), 0.2);
}

TEST(GuidedPredictive, TakesOverWithoutABump) {
  GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 40.0);
  GuidedPredictive controller(s);
  controller.take_over(40.0, 0.18);
  double last = 0.18;
  for (int k = 0; k < 50; ++k) {
    const double duty = controller.step(40.0, plant.angle_deg());
    EXPECT_NEAR(duty, last, 0.003);
    last = duty;
    plant.step(duty);
  }
}

template <class Controller, class T>
std::vector<T> driven(Controller& controller, int from, int to) {
  std::vector<T> duties;
  for (int k = from; k < to; ++k) {
    const double noise = 0.03 * std::sin(1.7 * k * k);
    duties.push_back(controller.step(T(driving(k)), T(driving(k - 20) + noise)));
  }
  return duties;
}

TEST(GuidedPredictive, ASavedOneGoesOnBitForBit) {
  for (const bool learning : {true, false}) {
    GuidedPredictiveSettings s = asymmetric();
    s.friction_learning = learning;
    GuidedPredictive first(s), second(s);
    driven<GuidedPredictive, double>(first, 20, 700);
    restore_state(second, save_state(first));
    EXPECT_EQ((driven<GuidedPredictive, double>(first, 700, 1200)),
              (driven<GuidedPredictive, double>(second, 700, 1200)));
    BasicGuidedPredictive<float> single(s), copy(s);
    driven<BasicGuidedPredictive<float>, float>(single, 20, 700);
    restore_state(copy, save_state(single));
    EXPECT_EQ((driven<BasicGuidedPredictive<float>, float>(single, 700, 900)),
              (driven<BasicGuidedPredictive<float>, float>(copy, 700, 900)));
    first.reset();
    GuidedPredictive made(s);
    EXPECT_EQ((driven<GuidedPredictive, double>(first, 20, 300)), (driven<GuidedPredictive, double>(made, 20, 300)));
  }
}

TEST(GuidedPredictive, FloatFollowsDouble) {
  GuidedPredictive wide(asymmetric());
  BasicGuidedPredictive<float> narrow(asymmetric());
  Plant a(asymmetric().plate, 30.0), b(asymmetric().plate, 30.0);
  double first = 0.0, second = 0.0;
  for (int k = 0; k < 4000; ++k) {
    a.step(wide.step(driving(k), a.angle_deg()));
    b.step(static_cast<double>(narrow.step(static_cast<float>(driving(k)), static_cast<float>(b.angle_deg()))));
    first += std::pow(driving(k) - a.angle_deg(), 2);
    second += std::pow(driving(k) - b.angle_deg(), 2);
  }
  EXPECT_NEAR(second, first, 0.02 * first);
}

TEST(GuidedPredictive, NeverAllocates) {
  for (const bool learning : {true, false}) {
    GuidedPredictiveSettings s = asymmetric();
    s.friction_learning = learning;
    GuidedPredictive controller(s);
    const std::array<double, 8> ahead{20.0, 21.0, 22.0, nan, 24.0, 25.0, 26.0, 27.0};
    const test_support::AllocationCounter counter;
    for (int k = 20; k < 500; ++k) {
      controller.prepare();
      controller.feedback(driving(k), driving(k - 20), ahead);
      controller.refine();
    }
    controller.take_over(20.0, 0.1);
    controller.reset();
    EXPECT_EQ(counter.count(), 0u);
  }
}

TEST(GuidedPredictive, RefusesByNameAndChangesNothing) {
  const auto refused = [](auto change) {
    GuidedPredictiveSettings s;
    change(s);
    try {
      const GuidedPredictive controller(s);
    } catch (const ParameterError& e) {
      return e.field;
    }
    return std::string("nothing");
  };
  EXPECT_EQ(refused([](auto& s) { s.plate.time_constant_s = 0.0; }), "time_constant_s");
  EXPECT_EQ(refused([](auto& s) { s.delay_samples = 6; }), "delay_samples");
  EXPECT_EQ(refused([](auto& s) { s.move_steps = {3, 0, 4}; }), "move_steps[1]");
  EXPECT_EQ(refused([](auto& s) { s.move_steps = {30, 30, 30}; }), "move_steps");
  EXPECT_EQ(refused([](auto& s) { s.gauss_newton_steps = 0; }), "gauss_newton_steps");
  EXPECT_EQ(refused([](auto& s) { s.highest_deg = s.lowest_deg; }), "highest_deg");
  EXPECT_EQ(refused([](auto& s) { s.noise_deg = nan; }), "noise_deg");
  GuidedPredictive controller(asymmetric());
  PlateBelief<double> belief = controller.belief();
  belief.gain_factor = 3.0;
  EXPECT_THROW(controller.set_belief(belief), ParameterError);
  EXPECT_EQ(controller.belief().gain_factor, 1.0);
  auto columns = save_state(controller);
  columns["friction_above"] = {0.9};
  EXPECT_THROW(restore_state(controller, columns), ParameterError);
  EXPECT_EQ(controller.belief().above.friction, 0.08);
}

}  // namespace
}  // namespace mgdd::control
