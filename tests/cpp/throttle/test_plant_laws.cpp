// Laws of the throttle plant: closed form of the linear part, energy, symmetry, backlash, presliding.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mgdd/throttle/plant.hpp"
#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

using test::deg;
using test::DrivenThrottle;
using test::rad;

Throttle frictionless() {
  Throttle t;
  t.coulomb_nm = t.stiction_nm = 0.0;
  t.preload_above_nm = t.preload_below_nm = 0.0;
  t.inductance_mh = 0.0;
  return t;
}

TEST(ThrottleLaws, WithoutFrictionAndPreloadItIsTheOverdampedOscillator) {
  const Throttle p = frictionless();
  const double b = p.damping_nms_per_rad() / (2.0 * p.inertia_kgm2);
  const double root = std::sqrt(b * b - p.spring_above_nm_per_rad / p.inertia_kgm2);
  const double s1 = -b + root;
  const double s2 = -b - root;
  EXPECT_NEAR(s1, -0.8298, 1e-4);
  EXPECT_NEAR(s2, -49.929, 1e-3);
  for (const auto& [step_s, bound] : {std::pair{1e-4, 4e-5}, {1e-3, 4e-4}}) {
    DrivenThrottle t(p, 9.8, step_s);
    double worst = 0.0;
    for (int k = 1; k * step_s <= 5.0; ++k) {
      t.step(0.0);
      const double time = k * step_s;
      const double exact = 8.0 + 1.8 * (s2 * std::exp(s1 * time) - s1 * std::exp(s2 * time)) / (s2 - s1);
      worst = std::fmax(worst, std::abs(t.angle_deg() - exact));
    }
    EXPECT_LT(worst, bound) << step_s;
    EXPECT_GT(worst, 0.3 * bound) << step_s;  // first order, not better
  }
}

// Energy of a chirp with mid-point powers; K = K_e, so motor and generator cancel.
double energy_residual(double amplitude, bool& dissipates) {
  constexpr double h = 2e-5;
  const Throttle p;
  DrivenThrottle t(p, 45.0, h);
  double electrical = 0.0;
  double spent = 0.0;
  dissipates = true;
  const auto stored = [&] {
    const double x = t.state.angle_rad - rad(p.limp_home_deg);
    const double ramp = rad(p.preload_ramp_deg);
    const double size = std::abs(x);
    const double preload = size < ramp ? 0.5 * size * size / ramp : size - 0.5 * ramp;
    const double over = std::fmax(t.state.angle_rad - rad(90.0), 0.0) + std::fmax(-t.state.angle_rad, 0.0);
    return 0.5 * p.inertia_kgm2 * t.state.speed_rad_per_s * t.state.speed_rad_per_s +
           0.5 * 1e-3 * p.inductance_mh * t.state.current_a * t.state.current_a +
           0.5 * p.spring_above_nm_per_rad * x * x + p.preload_above_nm * preload +
           0.5 * p.stop_stiffness_nm_per_rad * over * over;
  };
  const double before = stored();
  for (int k = 0; k * h < 10.0; ++k) {
    const double time = k * h;
    const double phase = 2.0 * M_PI * (0.2 * time + (6.0 - 0.2) * time * time / 20.0);
    t.input.duty = 0.15 + amplitude * std::sin(phase);
    const ThrottleState old = t.state;
    ThrottleTorques torques;
    t.plant.step(t.state, t.input, torques);
    const double w = 0.5 * (old.speed_rad_per_s + t.state.speed_rad_per_s);
    const double i = 0.5 * (old.current_a + t.state.current_a);
    const bool contact = old.angle_rad > rad(90.0) || old.angle_rad < 0.0;
    dissipates = dissipates && torques.friction_nm * t.state.speed_rad_per_s >= 0.0;
    electrical += h * t.input.duty * p.supply_v * i;
    spent += h * (p.resistance_ohm * i * i + torques.friction_nm * w + p.viscous_nms_per_rad * w * w +
                  (contact ? p.stop_damping_nms_per_rad * w * w : 0.0));
  }
  return (electrical - spent - (stored() - before)) / electrical;
}

TEST(ThrottleLaws, EnergyAddsUpAndFrictionOnlyTakes) {
  bool dissipates = false;
  EXPECT_LT(std::abs(energy_residual(0.20, dissipates)), 1e-4);
  EXPECT_TRUE(dissipates);
  EXPECT_LT(std::abs(energy_residual(0.50, dissipates)), 1e-3);  // reaches both stops
  EXPECT_TRUE(dissipates);
}

TEST(ThrottleLaws, ASymmetricThrottleMirrors) {
  for (const Friction form :
       {Friction::coulomb, Friction::stribeck, Friction::karnopp, Friction::tanh, Friction::lugre}) {
    for (const Backlash backlash : {Backlash::none, Backlash::compliance, Backlash::hysteresis}) {
      Throttle p;
      p.limp_home_deg = 45.0;
      p.stiction_nm = 0.30;
      p.friction = form;
      p.backlash = backlash;
      DrivenThrottle a(p, 60.0);
      DrivenThrottle b(p, 30.0);
      for (int k = 0; k < 20000; ++k) {
        const double duty = 0.45 * std::sin(7e-4 * k) + 0.2 * std::sin(4.1e-3 * k);
        a.step(duty);
        b.step(-duty);
        ASSERT_NEAR(a.state.plate_angle_rad - rad(45.0), rad(45.0) - b.state.plate_angle_rad, 2e-12)
            << static_cast<int>(form) << ' ' << static_cast<int>(backlash) << ' ' << k;
      }
    }
  }
}

TEST(ThrottleLaws, TheGapOfTheGearIsCrossedAndHeld) {
  Throttle p;
  p.backlash = Backlash::compliance;
  DrivenThrottle t(p, 8.0);
  double widest = 0.0;
  double least = 0.0;
  double fastest = 0.0;
  for (int k = 0; k < 40000; ++k) {
    t.step(0.5 * std::sin(2.0 * M_PI * 1.0 * k * 1e-4));
    const double gap = deg(t.state.angle_rad - t.state.plate_angle_rad);
    widest = std::fmax(widest, gap);
    least = std::fmin(least, gap);
    fastest = std::fmax(fastest, std::abs(t.state.speed_rad_per_s));
  }
  EXPECT_GT(widest, 0.2);
  EXPECT_LT(least, -0.2);
  // Beyond the gap only what stall torque and an impact bend.
  const double bend = deg(p.stall_torque_nm() / p.gear_stiffness_nm_per_rad +
                          fastest * std::sqrt(p.inertia_kgm2 / p.gear_stiffness_nm_per_rad));
  EXPECT_LT(widest, 0.2 + bend);
  EXPECT_GT(least, -0.2 - bend);
  t.go(0.0, 2.0);
  EXPECT_NEAR(t.angle_deg(), 8.0, 0.25 + 0.2);
}

// Two masses without a gap, rigid as the step allows, are the one mass.
TEST(ThrottleLaws, ANarrowGapIsNoGap) {
  const Throttle rigid;
  Throttle geared = rigid;
  geared.backlash = Backlash::compliance;
  geared.backlash_half_deg = 1e-6;
  geared.gear_stiffness_nm_per_rad = 2000.0;
  geared.gear_damping_nms_per_rad = 1.0;
  DrivenThrottle a(rigid, 30.0, 2e-5);
  DrivenThrottle b(geared, 30.0, 2e-5);
  a.go(0.35, 0.1);
  b.go(0.35, 0.1);
  EXPECT_NEAR(a.angle_deg(), b.angle_deg(), 0.2);
  EXPECT_GT(a.angle_deg(), 40.0);
}

TEST(ThrottleLaws, ThePlayFollowsWithHalfAGap) {
  Throttle p;
  p.backlash = Backlash::hysteresis;
  DrivenThrottle t(p, 30.0);
  for (int k = 0; k < 30000; ++k) {
    t.step(0.15 + 0.3 * std::sin(2e-3 * k));
    ASSERT_LE(std::abs(deg(t.state.angle_rad - t.state.plate_angle_rad)), 0.2 + 1e-12);
  }
}

// A side of the gap without friction is the limit of a side with next to none.
TEST(ThrottleLaws, ASideWithoutFrictionIsTheLimitOfATinyShare) {
  for (const Friction form : {Friction::coulomb, Friction::stiction, Friction::stribeck, Friction::karnopp,
                              Friction::tanh, Friction::lugre}) {
    for (const bool plate_is_free : {true, false}) {
      const auto with_share = [&](double share) {
        Throttle p;
        p.stiction_nm = 0.31;
        p.backlash = Backlash::compliance;
        p.friction = form;
        p.plate_friction_share = plate_is_free ? share : 1.0 - share;
        return DrivenThrottle(p, 30.0);
      };
      DrivenThrottle none = with_share(0.0);
      DrivenThrottle tiny = with_share(1e-9);
      double worst = 0.0;
      for (int k = 0; k < 5000; ++k) {
        const double duty = 0.2 + 0.4 * std::sin(2.5e-3 * k);
        none.step(duty);
        tiny.step(duty);
        ASSERT_TRUE(std::isfinite(none.angle_deg())) << static_cast<int>(form) << ' ' << k;
        worst = std::fmax(worst, std::abs(none.angle_deg() - tiny.angle_deg()));
      }
      EXPECT_LT(worst, 1e-4) << static_cast<int>(form) << ' ' << plate_is_free;
      EXPECT_GT(std::abs(none.angle_deg() - 30.0), 5.0);
    }
  }
}

// Bristles on both sides of a closed gap share the load as the friction is shared: the deflection is that of one mass.
TEST(ThrottleLaws, PreslidingIsTheSameHoweverTheFrictionIsShared) {
  Throttle whole;
  whole.friction = Friction::lugre;
  whole.inductance_mh = 0.0;
  const auto bend_deg = [](const Throttle& p) {
    DrivenThrottle t(p, 40.0);
    const double balance = t.spring_nm(40.0) / p.stall_torque_nm();
    t.go(balance + 0.2 * p.coulomb_nm / p.stall_torque_nm(), 0.3);
    return t.angle_deg() - 40.0;
  };
  const double expected = bend_deg(whole);
  EXPECT_GT(expected, 0.03);
  Throttle geared = whole;
  geared.backlash = Backlash::compliance;
  geared.backlash_half_deg = 1e-6;
  geared.gear_stiffness_nm_per_rad = 20000.0;
  for (const double share : {0.0, 0.3, 0.8, 1.0}) {
    geared.plate_friction_share = share;
    EXPECT_NEAR(bend_deg(geared), expected, 0.03 * expected) << share;
  }
}

// Below breakaway the bristles bend and spring back but for a share that grows with the load (T/T_d: 0.1 here).
TEST(ThrottleLaws, BristlesSpringBack) {
  Throttle p;
  p.friction = Friction::lugre;
  p.inductance_mh = 0.0;
  p.spring_above_nm_per_rad = p.preload_above_nm = p.preload_below_nm = 0.0;
  DrivenThrottle t(p, 40.0);
  const double torque = 0.1 * p.coulomb_nm;
  t.go(torque / p.stall_torque_nm(), 0.5);
  EXPECT_NEAR(t.angle_deg() - 40.0, deg(torque / p.bristle_nm_per_rad), 0.1 * deg(torque / p.bristle_nm_per_rad));
  const double creep = deg(torque / p.bristle_nm_per_rad);
  t.go(0.0, 0.5);
  EXPECT_NEAR(t.angle_deg(), 40.0, 0.15 * creep);
}

TEST(ThrottleLaws, AirFlowClosesThePlate) {
  Throttle p;
  p.pressure_drop_kpa = 30.0;
  EXPECT_NEAR(airflow_torque_nm(p, 75.0), -0.216e-3 * 30e3 * 0.085, 1e-12);
  EXPECT_EQ(airflow_torque_nm(p, 0.0), 0.0);
  EXPECT_EQ(airflow_torque_nm(p, 90.0), 0.0);
  DrivenThrottle still(Throttle{}, 70.0);
  DrivenThrottle blown(p, 70.0);
  const double duty = still.spring_nm(70.0) / p.stall_torque_nm();
  still.go(duty, 1.0);
  blown.go(duty, 1.0);
  EXPECT_NEAR(still.angle_deg(), 70.0, 0.01);
  EXPECT_LT(blown.angle_deg(), 69.0);
}

}  // namespace
}  // namespace mgdd::throttle
