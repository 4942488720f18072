// PID of a plate: laws of each part, anti-windup, no steady error, mirrored plants, both scalars.
#include "mgdd/control/pid.hpp"

#include "support/test.hpp"

namespace mgdd::control {
namespace {

static_assert(noexcept(std::declval<Pid&>().step(0.0, 0.0)));
static_assert(noexcept(std::declval<BasicPid<float>&>().step(0.0F, 0.0F)));

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Every part at work, both sides of limp-home different.
PidSettings lively() {
  PidSettings s;
  s.above = {.proportional_per_deg = 0.05, .integral_per_deg_s = 0.9, .derivative_s_per_deg = 7e-4};
  s.below = {.proportional_per_deg = 0.03, .integral_per_deg_s = 0.5, .derivative_s_per_deg = 4e-4};
  s.plate.spring.limp_home_deg = 11.0;
  s.plate.spring.above = {.preload = 0.13, .per_deg = 6e-4};
  s.plate.spring.below = {.preload = 0.17, .per_deg = 9e-4};
  s.kick = 0.04;
  s.kick_width_deg = 0.3;
  s.dead_band_deg = 0.02;
  s.integral_window_deg = 5.0;
  return s;
}

/// Nothing but the gains.
PidSettings bare(const PidGains& gains) {
  PidSettings s;
  s.above = s.below = gains;
  s.plate.spring.above = s.plate.spring.below = {0.0, 0.0};
  s.kick = s.dead_band_deg = s.rate_s_per_deg = s.plate.friction = 0.0;
  s.integral_window_deg = 1e3;
  s.integral_limit = 1.0;
  return s;
}

/// Angle and speed under duty and a disturbance in duty; no friction.
struct Plate {
  double angle_deg = 0.0, speed_deg_per_s = 0.0;
  double gain = 40000.0, damping_per_s = 50.0;

  void step(double duty, double disturbance) {
    speed_deg_per_s += 1e-3 * (gain * (duty + disturbance) - damping_per_s * speed_deg_per_s);
    angle_deg += 1e-3 * speed_deg_per_s;
  }
};

double reference_of(int k) {
  return k < 150 ? 30.0 : 14.0 + 9.0 * std::sin(0.01 * k);
}
double measurement_of(int k) {
  return 12.0 + 8.0 * std::sin(0.013 * k) + 0.05 * std::cos(2.1 * k);
}

TEST(Pid, EachTermIsItsOwn) {
  EXPECT_NEAR(Pid(bare({0.02, 0.0, 0.0})).step(30.0, 26.5), 0.02 * 3.5, 1e-15);
  EXPECT_NEAR(Pid(bare({0.0, 0.8, 0.0})).step(30.0, 26.5), 0.8 * 3.5 * 1e-3, 1e-15);

  PidSettings with_kick = bare({});
  with_kick.above = with_kick.below = {0.0, 0.0, 0.0};
  with_kick.kick = 0.07;
  with_kick.kick_width_deg = 0.5;
  with_kick.dead_band_deg = 0.1;
  EXPECT_NEAR(Pid(with_kick).step(20.0, 20.2), -0.07 * 0.4, 1e-14);
  EXPECT_EQ(Pid(with_kick).step(20.0, 21.0), -0.07);
  EXPECT_EQ(Pid(with_kick).step(20.0, 20.09), 0.0);

  PidSettings with_spring = bare({0.0, 0.0, 0.0});
  with_spring.plate.spring = lively().plate.spring;
  EXPECT_NEAR(Pid(with_spring).step(31.0, 50.0), 0.13 + 6e-4 * 20.0, 1e-15);
  EXPECT_NEAR(Pid(with_spring).step(3.0, 50.0), -0.17 - 9e-4 * 8.0, 1e-15);
  EXPECT_NEAR(Pid(with_spring).step(11.25, 50.0), 0.13 * 0.5 + 6e-4 * 0.25, 1e-15);
}

TEST(Pid, TheDerivativeSeesTheMeasurementAloneAndStartsWithoutAKick) {
  Pid pid(bare({0.0, 0.0, 0.002}));
  EXPECT_EQ(pid.step(10.0, 40.0), 0.0);
  EXPECT_EQ(pid.step(60.0, 40.0), 0.0);
  double duty = 0.0;
  for (int k = 1; k <= 60; ++k)
    duty = pid.step(60.0, 40.0 + 0.1 * k);
  EXPECT_NEAR(duty, -0.002 * 100.0, 1e-8);  // of 100 deg/s, the lag is past
}

TEST(Pid, AReferenceThatMovesIsFollowedByItsRateAndOneThatStepsIsNot) {
  PidSettings s = bare({0.0, 0.0, 0.0});
  s.rate_s_per_deg = 1e-3;
  s.plate.friction = 0.06;
  s.friction_rate_deg_per_s = 20.0;
  Pid pid(s);
  double duty = 0.0;
  for (int k = 0; k < 80; ++k)
    duty = pid.step(30.0 - 0.05 * k, 30.0);
  EXPECT_NEAR(duty, -1e-3 * 50.0 - 0.06, 1e-7);
  EXPECT_EQ(pid.step(60.0, 30.0), 0.0);
}

TEST(Pid, GainsFollowTheSideOfTheMeasurement) {
  PidSettings s = bare({});
  s.plate.spring.limp_home_deg = 11.0;
  s.above = {0.02, 0.0, 0.0};
  s.below = {0.05, 0.0, 0.0};
  EXPECT_NEAR(Pid(s).step(4.0, 12.0), -0.02 * 8.0, 1e-15);
  EXPECT_NEAR(Pid(s).step(18.0, 10.0), 0.05 * 8.0, 1e-15);
  EXPECT_NEAR(Pid(s).step(19.0, 11.0), 0.035 * 8.0, 1e-15);
}

TEST(Pid, NoSteadyErrorUnderAConstantDisturbanceWithTheIntegralAndOneWithout) {
  for (const bool integral : {true, false}) {
    Pid pid(bare({0.03, integral ? 0.3 : 0.0, 5e-4}));
    Plate plate;
    for (int k = 0; k < 6000; ++k)
      plate.step(pid.step(25.0, plate.angle_deg), -0.06);
    if (integral) {
      EXPECT_NEAR(plate.angle_deg, 25.0, 1e-6);
      EXPECT_NEAR(pid.integral(), 0.06, 1e-6);
    } else {
      EXPECT_NEAR(25.0 - plate.angle_deg, 0.06 / 0.03, 1e-6);
    }
  }
}

TEST(Pid, AntiWindupTheIntegralStopsWhileABoundHoldsTheDutyAndLeavesAtOnce) {
  PidSettings s = bare({0.02, 0.5, 0.0});
  s.duty.upper = 0.4;
  s.duty.lower = -0.7;
  Pid pid(s);
  for (int k = 0; k < 3000; ++k)
    EXPECT_LE(pid.step(60.0, 20.0), 0.4);
  EXPECT_LE(pid.integral(), 0.4);
  EXPECT_LT(pid.step(60.0, 61.0), 0.4);  // no time to unwind
  // Driven below by a jammed plate, the other bound.
  pid.reset();
  EXPECT_EQ(pid.duty(), 0.0);
  for (int k = 0; k < 3000; ++k)
    EXPECT_GE(pid.step(2.0, 60.0), -0.7);
  EXPECT_GT(pid.step(2.0, 1.0), -0.7);
}

TEST(Pid, AntiWindupHoldsForSmallErrorsToo) {
  PidSettings s = bare({1.0, 0.5, 0.0});
  s.duty.upper = 0.4;
  s.duty.lower = -0.3;
  for (const double error : {0.5, -0.5}) {
    Pid pid(s);
    for (int k = 0; k < 100; ++k)
      (void)pid.step(20.0 + error, 20.0);
    EXPECT_EQ(pid.integral(), 0.0);
  }
}

TEST(Pid, TheIntegralKeepsToItsWindowAndItsLimit) {
  PidSettings s = bare({0.0, 0.5, 0.0});
  s.integral_window_deg = 3.0;
  s.integral_limit = 0.12;
  Pid pid(s);
  for (int k = 0; k < 4000; ++k)
    (void)pid.step(10.0, 13.5);
  EXPECT_EQ(pid.integral(), 0.0);
  for (int k = 0; k < 4000; ++k)
    (void)pid.step(10.0, 12.0);
  EXPECT_EQ(pid.integral(), -0.12);
}

TEST(Pid, AMirroredPlantIsDrivenByTheMirroredDuty) {
  PidSettings s = lively();
  s.plate.spring.limp_home_deg = 32.0;
  PidSettings mirrored = s;
  std::swap(mirrored.above, mirrored.below);
  std::swap(mirrored.plate.spring.above, mirrored.plate.spring.below);
  Pid one(s), other(mirrored);
  for (int k = 0; k < 800; ++k) {
    const double r = 21.0 + reference_of(k), y = 21.0 + measurement_of(k);
    EXPECT_NEAR(one.step(r, y), -other.step(64.0 - r, 64.0 - y), 1e-12) << k;
  }
}

TEST(Pid, FloatAgreesWithDouble) {
  Pid wide(lively());
  BasicPid<float> narrow(lively());
  for (int k = 0; k < 2000; ++k) {
    const auto r = static_cast<float>(reference_of(k)), y = static_cast<float>(measurement_of(k));
    EXPECT_NEAR(narrow.step(r, y), wide.step(r, y), 2e-4) << k;
  }
}

TEST(Pid, InputsThatAreNotFiniteRepeatTheLastOnes) {
  Pid one(lively()), other(lively());
  EXPECT_EQ(one.step(nan, 3.0), 0.0);
  EXPECT_EQ(one.step(3.0, nan), other.step(3.0, 3.0));
  for (int k = 0; k < 60; ++k) {
    const int held = k - k % 3;
    const double r = reference_of(held), y = measurement_of(held);
    if (k % 3 == 0) {
      EXPECT_EQ(one.step(r, y), other.step(r, y));
      continue;
    }
    const double duty = one.step(nan, std::numeric_limits<double>::infinity());
    EXPECT_TRUE(std::isfinite(duty));
    (void)other.step(nan, nan);
  }
}

TEST(Pid, EveryNumberOfTheSettingsHasOneField) {
  PidSettings s;
  double at = 0.5;
  for (const auto& field : pid_fields())
    field.in(s) = at += 1.0;
  constexpr std::size_t unused = 5;  // gain, time constant, electrical lag and travel of the plate
  EXPECT_EQ(sizeof(PidSettings), (pid_fields().size() + unused) * sizeof(double));
  std::vector<double> seen;
  for (const auto& field : pid_fields())
    seen.push_back(field.in(s));
  for (std::size_t i = 0; i < seen.size(); ++i)
    EXPECT_EQ(seen[i], 1.5 + static_cast<double>(i));
}

}  // namespace
}  // namespace mgdd::control
