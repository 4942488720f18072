// Which delay explains the readings: the rule on made-up innovations, and the controller on a plate that acts later
// than it was told.
#include "mgdd/control/delay_bank.hpp"

#include "mgdd/control/guided_predictive.hpp"
#include "support/guided_plate.hpp"
#include "support/test.hpp"

namespace mgdd::control {
namespace {

using namespace test_support;

using Innovations = std::array<double, most_delays>;

constexpr double noise = 0.05;  // deg

/// Innovations that grow by 0.1 deg with every sample by which a member is wrong.
Innovations wrong_by(int delay, double step_deg = 0.1) {
  Innovations e{};
  for (int j = 0; j < most_delays; ++j)
    e[static_cast<std::size_t>(j)] = 0.02 + step_deg * std::abs(j - delay);
  return e;
}

int readings_until(DelayBank<double>& bank, const Innovations& e, int most = 400) {
  for (int k = 1; k <= most; ++k) {
    if (bank.judge(e)) return k;
  }
  return -1;
}

TEST(DelayBank, TakesTheMemberThatExplainsTheReadings) {
  for (const int delay : {2, 3, 5, 6}) {
    DelayBank<double> bank(most_delays, 1e-3, noise);
    const int readings = readings_until(bank, wrong_by(delay));
    EXPECT_EQ(bank.chosen(), delay);
    EXPECT_GE(readings, delay > 3 ? 5 : 15) << delay;
    EXPECT_LT(readings, 60) << delay;
  }
}

TEST(DelayBank, LeavesANeighbourAsItIs) {
  DelayBank<double> bank(most_delays, 1e-3, noise);
  EXPECT_EQ(readings_until(bank, wrong_by(1)), -1);
  for (int k = 0; k < 400; ++k)  // by way of those between
    bank.judge(wrong_by(4));
  ASSERT_EQ(bank.chosen(), 4);
  EXPECT_EQ(readings_until(bank, wrong_by(3)), -1);
  EXPECT_EQ(readings_until(bank, wrong_by(5)), -1);
}

TEST(DelayBank, ASampleOfTwoMillisecondsIsMoreThanALag) {
  DelayBank<double> bank(most_delays, 2e-3, noise);
  EXPECT_GT(readings_until(bank, wrong_by(1)), 0);
  EXPECT_EQ(bank.chosen(), 1);
}

TEST(DelayBank, LearnsNothingWhereMembersAgreeOrNoneExplains) {
  DelayBank<double> bank(most_delays, 1e-3, noise);
  EXPECT_EQ(readings_until(bank, wrong_by(5, 0.02)), -1);  // 0.12 deg apart
  Innovations far = wrong_by(5);
  for (double& one : far)
    one += 0.4;
  EXPECT_EQ(readings_until(bank, far), -1);
  EXPECT_GT(readings_until(bank, wrong_by(5)), 0);
}

TEST(DelayBank, OneReadingFarOffDecidesNothing) {
  DelayBank<double> bank(most_delays, 1e-3, noise);
  Innovations odd = wrong_by(5);
  for (double& one : odd)
    one += 1e6;
  EXPECT_FALSE(bank.judge(odd));
  for (int k = 0; k < 4; ++k)
    EXPECT_FALSE(bank.judge(wrong_by(5))) << "four readings are too few";
  EXPECT_EQ(readings_until(bank, wrong_by(0)), -1);
}

TEST(DelayBank, GoesBackToAShorterDelay) {
  DelayBank<double> bank(most_delays, 1e-3, noise);
  ASSERT_GT(readings_until(bank, wrong_by(6)), 0);
  ASSERT_GT(readings_until(bank, wrong_by(1)), 0);
  EXPECT_EQ(bank.chosen(), 1);
}

TEST(DelayBank, TriesNoMoreMembersThanThereAre) {
  DelayBank<double> bank(3, 1e-3, noise);
  Innovations e = wrong_by(2);
  e[5] = 0.0;
  ASSERT_GT(readings_until(bank, e), 0);
  EXPECT_EQ(bank.chosen(), 2);
}

/// Swing over the last 0.3 s of a step, of a plate whose duty acts later than the controller was told.
template <class T>
double swing(BasicGuidedPredictive<T>& controller, int later, int samples = 900) {
  Plant plant(asymmetric().plate, 25.0);
  plant.believe({{0.01, 0.05}, {-0.02, 0.035}, 1.0, 0.85});
  std::vector<double> waiting(static_cast<std::size_t>(later), 0.14);
  double low = 1e3, high = -1e3;
  for (int k = 0; k < samples; ++k) {
    const double measured = plant.angle_deg() + 0.04 * std::sin(1.7 * k * k);
    waiting.push_back(double(controller.step(T(k < 300 ? 25.0 : 57.0), T(measured))));
    plant.step(waiting.front());
    waiting.erase(waiting.begin());
    if (k < samples - 300) continue;
    low = std::min(low, plant.angle_deg());
    high = std::max(high, plant.angle_deg());
  }
  return high - low;
}

TEST(GuidedPredictive, ADelayThatWasNotToldIsFound) {
  GuidedPredictiveSettings without = asymmetric();
  without.delay_search_samples = 0;
  for (const int later : {5, 6}) {
    GuidedPredictive controller(asymmetric()), blind(without);
    BasicGuidedPredictive<float> narrow(asymmetric());
    EXPECT_GT(swing(blind, later), 5.0) << later;
    EXPECT_LT(swing(controller, later), 0.2) << later;
    EXPECT_LT(swing(narrow, later), 0.2) << later;
    EXPECT_NEAR(controller.delay_samples(), 1 + later, 1) << later;
    EXPECT_EQ(blind.delay_samples(), 1);
  }
}

TEST(GuidedPredictive, WithTheDelayThatWasToldTheBankChangesNothing) {
  GuidedPredictiveSettings without = asymmetric();
  without.delay_search_samples = 0;
  GuidedPredictive searching(asymmetric()), blind(without);
  Plant plant(asymmetric().plate, 30.0);
  for (int k = 0; k < 4000; ++k) {
    const double duty = searching.step(driving(k), plant.angle_deg());
    ASSERT_EQ(duty, blind.step(driving(k), plant.angle_deg())) << k;
    plant.step(duty);
  }
  EXPECT_EQ(searching.delay_samples(), 1);
}

TEST(GuidedPredictive, WhatAWrongDelayTaughtIsNotGoneBackTo) {
  GuidedPredictive controller(asymmetric());
  swing(controller, 5);
  ASSERT_GT(controller.delay_samples(), 1);
  const std::int64_t before = controller.rollbacks();
  swing(controller, 5, 3000);
  EXPECT_EQ(controller.rollbacks(), before);
  EXPECT_NEAR(controller.certified().gain_factor, 1.0, 0.2);
}

TEST(GuidedPredictive, TheLongestDelayLeavesNoMembers) {
  GuidedPredictiveSettings s = asymmetric();
  s.delay_samples = longest_control_delay;
  GuidedPredictive controller(s);
  swing(controller, 20);
  EXPECT_EQ(controller.delay_samples(), longest_control_delay);
}

/// Most samples by which the delay was misjudged behind a gate that clamps and slews, over ten steps.
template <class T>
int misjudged_behind_a_gate(BasicGuidedPredictive<T>& controller, bool told) {
  Plant plant(asymmetric().plate, 20.0);
  double left = 0.1;
  int most = 0;
  for (int k = 0; k < 4000; ++k) {
    const double measured = plant.angle_deg() + 0.04 * std::sin(1.7 * k * k);
    const auto asked = double(controller.step(T(k / 400 % 2 == 0 ? 20.0 : 60.0), T(measured)));
    left = std::clamp(std::clamp(asked, -0.3, 0.3), left - 0.012, left + 0.012);
    if (told) controller.set_sent(T(left));
    plant.step(left);
    most = std::max(most, controller.delay_samples() - controller.settings().delay_samples);
  }
  return most;
}

TEST(GuidedPredictive, WhatAGateChangedIsNoDelay) {
  GuidedPredictive told(asymmetric()), left_alone(asymmetric());
  BasicGuidedPredictive<float> narrow(asymmetric());
  EXPECT_EQ(misjudged_behind_a_gate(told, true), 0);
  EXPECT_EQ(misjudged_behind_a_gate(narrow, true), 0);
  EXPECT_GT(misjudged_behind_a_gate(left_alone, false), 0);
}

TEST(GuidedPredictive, TheDutyThatLeftAsAskedChangesNothing) {
  GuidedPredictive told(asymmetric()), plain(asymmetric());
  Plant plant(asymmetric().plate, 30.0);
  for (int k = 0; k < 1500; ++k) {
    const double duty = told.step(driving(k), plant.angle_deg());
    ASSERT_EQ(duty, plain.step(driving(k), plant.angle_deg())) << k;
    told.set_sent(duty);
    told.set_sent(std::numeric_limits<double>::quiet_NaN());
    plant.step(duty);
  }
}

}  // namespace
}  // namespace mgdd::control
