// Facts of the throttle plant at rest and in steps: limp-home, breakaway, hysteresis, times, end stops, step size.
#include "mgdd/throttle/plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

using test::deg;
using test::DrivenThrottle;
using test::stiff_spring;

TEST(ThrottlePlant, LimpHomeIsTheRestPositionIfThePreloadBeatsTheFriction) {
  for (const double start : {0.0, 30.0, 90.0}) {
    DrivenThrottle t(Throttle{}, start);
    t.go(0.0, 5.0);
    EXPECT_NEAR(t.angle_deg(), 8.0, 0.25) << start;
    EXPECT_EQ(t.state.speed_rad_per_s, 0.0);
  }
}

TEST(ThrottlePlant, AFrictionAboveThePreloadLeavesABandOfRest) {
  Throttle p;
  p.preload_above_nm = p.preload_below_nm = 0.2;
  p.spring_above_nm_per_rad = p.spring_below_nm_per_rad = 0.819;
  const double band = deg((p.coulomb_nm - 0.2) / 0.819);
  for (const double above : {10.0, 15.0, 20.0}) {
    DrivenThrottle t(p, 8.0 + above);
    t.go(0.0, 5.0);
    EXPECT_NEAR(t.angle_deg() - 8.0, band, 0.1) << above;
  }
  for (const auto& [above, rest] : {std::pair{10.0, 2.9}, {15.0, -0.1}, {20.0, -1.1}}) {
    DrivenThrottle t(p, 8.0 + above);  // without the motor's brake it overruns the band's edge
    t.input.bridge = Bridge::open;
    t.go(0.0, 5.0);
    EXPECT_NEAR(t.angle_deg() - 8.0, rest, 0.06) << above;
  }
}

TEST(ThrottlePlant, BreakawayDutyIsPreloadPlusStictionOverStallTorque) {
  for (const double sign : {1.0, -1.0}) {
    for (const auto& [supply, duty] : {std::pair{10.0, 0.2663}, {12.0, 0.2219}, {14.4, 0.1849}}) {
      Throttle p;
      p.supply_v = supply;
      const double expected = (p.preload_above_nm + p.stiction_nm) / p.stall_torque_nm();
      EXPECT_NEAR(expected, duty, 5e-5);
      DrivenThrottle t(p, 8.0);
      const double left =
          t.ramp(0.0, sign * 0.01, [](const DrivenThrottle& d) { return std::abs(d.angle_deg() - 8.0) > 0.3; });
      EXPECT_NEAR(sign * left, expected, 0.0015);  // 0.2230 at 12 V
      EXPECT_GT(sign * left, expected);
    }
  }
}

TEST(ThrottlePlant, HysteresisIsTwiceTheCoulombFriction) {
  DrivenThrottle t(Throttle{}, 8.0);
  double up = 0.0;
  const double turn = t.ramp(0.0, 0.005, [&](const DrivenThrottle& d) {
    if (d.angle_deg() < 45.0) up = d.input.duty;
    return d.angle_deg() > 70.0;
  });
  const double down = t.ramp(turn, -0.005, [](const DrivenThrottle& d) { return d.angle_deg() < 45.0; });
  EXPECT_NEAR(up - down, 0.1975, 0.002);
  const double g = t.parameters.stall_torque_nm();
  const double speed = 0.005 * g / t.parameters.spring_above_nm_per_rad;
  EXPECT_NEAR(up - down, 2.0 * (t.parameters.coulomb_nm + t.parameters.damping_nms_per_rad() * speed) / g, 0.002);
}

TEST(ThrottlePlant, TheStickBandInDutyAndInAngle) {
  DrivenThrottle t(stiff_spring(), 8.0);
  t.go(0.20, 3.0);
  const double from_below = t.angle_deg();
  const double lower = t.ramp(0.20, -0.002, [&](const DrivenThrottle& d) { return d.angle_deg() < from_below - 1e-3; });
  const double g = t.parameters.stall_torque_nm();
  EXPECT_NEAR(0.20 - lower, 2.0 * t.parameters.coulomb_nm / g, 0.01 * 2.0 * t.parameters.coulomb_nm / g);

  DrivenThrottle from_above(stiff_spring(), 90.0);
  from_above.go(0.20, 3.0);
  const double width = deg(2.0 * t.parameters.coulomb_nm / t.parameters.spring_above_nm_per_rad);
  EXPECT_NEAR(from_above.angle_deg() - from_below, width, 0.01 * width);
}

TEST(ThrottlePlant, TimesOfFullStepsAndOfTheReturn) {
  const Throttle p;
  EXPECT_NEAR(DrivenThrottle(p, 8.0).until(1.0, 8.0 + 0.1 * 82.0), 0.019, 0.002);
  EXPECT_NEAR(DrivenThrottle(p, 8.0).until(1.0, 8.0 + 0.9 * 82.0), 0.078, 0.002);
  EXPECT_NEAR(DrivenThrottle(p, 8.0).until(1.0, 90.0), 0.085, 0.002);
  EXPECT_NEAR(DrivenThrottle(p, 90.0).until(-1.0, 0.0), 0.071, 0.002);
  DrivenThrottle open(p, 90.0);
  open.input.bridge = Bridge::open;
  EXPECT_NEAR(open.until(0.0, 9.0), 0.191, 0.03 * 0.191);
  EXPECT_NEAR(DrivenThrottle(p, 90.0).until(0.0, 9.0), 0.905, 0.03 * 0.905);
  EXPECT_NEAR(DrivenThrottle(p, 0.0).until(0.0, 7.0), 0.128, 0.03 * 0.128);
}

// The third throttle has no back-EMF: both bridges return it alike.
TEST(ThrottlePlant, ReturnToTheLimpHomeBandOfTheThreePresets) {
  Throttle third;
  third.inertia_kgm2 = 0.0035;
  third.viscous_nms_per_rad = 0.1503;
  third.torque_constant_nm_per_a = 0.24;
  third.back_emf_vs_per_rad = 0.0;
  third.resistance_ohm = 1.0;
  third.inductance_mh = 0.0;
  third.limp_home_deg = 12.0;
  third.spring_above_nm_per_rad = third.spring_below_nm_per_rad = 0.0914;
  third.preload_above_nm = third.preload_below_nm = 0.3193;
  third.coulomb_nm = third.stiction_nm = 0.089;
  for (const auto& [p, seconds] : {std::pair{Throttle{}, 0.315}, {third, 0.745}}) {
    DrivenThrottle t(p, 90.0);
    t.input.bridge = Bridge::open;
    double last_outside = 0.0;
    for (int k = 0; k < 20000; ++k) {
      t.step(0.0);
      if (std::abs(t.angle_deg() - p.limp_home_deg) > 0.25) last_outside = (k + 1) * 1e-4;
    }
    EXPECT_NEAR(last_outside, seconds, 0.03 * seconds);
  }
}

TEST(ThrottlePlant, HeldByHalfTheFrictionItDoesNotMove) {
  Throttle p;
  p.inductance_mh = 0.0;
  DrivenThrottle t(p, 40.0);
  const double duty = (t.spring_nm(40.0) + 0.5 * p.coulomb_nm) / p.stall_torque_nm();
  t.go(duty, 1.0);
  EXPECT_NEAR(t.angle_deg(), 40.0, 1e-9);
  p.friction = Friction::tanh;
  for (const auto& [width, drift] : {std::pair{0.05, 1.52}, {0.01, 0.31}}) {
    p.tanh_rad_per_s = width;
    DrivenThrottle smooth(p, 40.0);
    smooth.go(duty, 1.0);
    EXPECT_NEAR(smooth.angle_deg() - 40.0, drift, 0.02 * drift) << width;
  }
}

TEST(ThrottlePlant, ConvergesWithTheFirstOrder) {
  const std::pair<double, double> printed[] = {{1e-3, 33.368}, {5e-4, 33.518}, {2e-4, 33.575},
                                               {1e-4, 33.599}, {5e-5, 33.610}, {1e-5, 33.620}};
  for (const auto& [step_s, angle] : printed) {
    DrivenThrottle t(Throttle{}, 8.0, step_s);
    t.go(0.6, 0.06);
    EXPECT_NEAR(t.angle_deg(), angle, 0.0006) << step_s;
  }
}

TEST(ThrottlePlant, EndStopHoldsTheStall) {
  DrivenThrottle t(Throttle{}, 8.0);
  t.until(1.0, 90.0);
  double peak = 0.0;
  double lowest = 90.0;
  for (int k = 0; k < 3000; ++k) {
    t.step(1.0);
    peak = std::fmax(peak, t.angle_deg() - 90.0);
    lowest = std::fmin(lowest, t.angle_deg());
  }
  EXPECT_NEAR(peak, 0.37, 0.01);
  EXPECT_GE(lowest, 90.0);  // no rebound
  const double penetration = deg((t.parameters.stall_torque_nm() - t.spring_nm(90.0)) / 5000.0);
  EXPECT_NEAR(penetration, 0.029, 5e-4);
  EXPECT_NEAR(t.angle_deg() - 90.0, penetration, 0.15 * penetration);
}

// u = 0.15 + 0.18 sin(2 pi f t) from limp-home: friction makes the mean depend on history, so start and phase are
// fixed.
TEST(ThrottlePlant, TheSpanFallsWithTheFrequency) {
  const std::pair<double, double> printed[] = {{0.1, 82.3}, {0.5, 62.0}, {1.0, 33.0},
                                               {2.0, 16.2}, {5.0, 5.8},  {10.0, 2.4}};
  double before = 1e9;
  for (const auto& [f, span] : printed) {
    DrivenThrottle t(Throttle{}, 8.0);
    const double seconds = std::fmax(3.0, 3.0 / f);
    double low = 1e9;
    double high = -1e9;
    const long n = std::lround(seconds / 1e-4);
    for (long k = 0; k < n; ++k) {
      const double time = static_cast<double>(k) * 1e-4;
      t.step(0.15 + 0.18 * std::sin(2.0 * M_PI * f * time));
      if (time >= seconds - 1.0 / f) {
        low = std::fmin(low, t.angle_deg());
        high = std::fmax(high, t.angle_deg());
      }
    }
    EXPECT_NEAR(high - low, span, 0.03 * span) << f;
    EXPECT_LT(high - low, before);
    before = high - low;
  }
}

// On both sides of limp-home, where the spring pulls the other way: between the two duties it holds, beyond it moves.
TEST(ThrottlePlant, HeldPlateMovesBeyondItsBreakawayDuties) {
  Throttle p;
  p.backlash = Backlash::none;
  for (const double angle : {3.0, 30.0, 60.0}) {
    const DrivenThrottle rest(p, angle);
    const auto [lower, upper] = rest.plant.breakaway(rest.state, rest.input);
    EXPECT_LT(lower, upper);
    for (const auto& [duty, moves] :
         {std::pair{lower - 0.01, -1.0}, {lower + 0.01, 0.0}, {upper - 0.01, 0.0}, {upper + 0.01, 1.0}}) {
      DrivenThrottle t(p, angle);
      t.go(duty, 0.5);
      const double moved = t.angle_deg() - angle;
      EXPECT_TRUE(moves == 0.0 ? std::abs(moved) < 0.05 : moves * moved > 0.3) << angle << " " << duty << " " << moved;
    }
  }
}

}  // namespace
}  // namespace mgdd::throttle
