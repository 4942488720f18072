// Energy, term by term: the work of every torque is what its potential, its loss or its source says, so that no term
// can stand for another. Work is torque times the way of the step; the scheme is of first order, and so is the
// remainder.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "support/asymmetric_throttle.hpp"
#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;
using test::deg;
using test::DrivenThrottle;
using test::rad;

constexpr double step_s = 1e-5;
constexpr double run_s = 6.0;

double spring_potential(const Throttle& p, double angle_rad) {
  const double x = angle_rad - rad(p.limp_home_deg);
  const double ramp = rad(p.preload_ramp_deg);
  const double size = std::abs(x);
  const double preload = size < ramp ? 0.5 * size * size / ramp : size - 0.5 * ramp;
  return 0.5 * (x > 0.0 ? p.spring_above_nm_per_rad : p.spring_below_nm_per_rad) * x * x +
         (x > 0.0 ? p.preload_above_nm : p.preload_below_nm) * preload;
}

double into_stop(const Throttle& p, double angle_rad) {
  return std::fmax(angle_rad - rad(p.open_deg), 0.0) + std::fmax(rad(p.closed_deg) - angle_rad, 0.0);
}

/// Work that the modelled air flow takes from closed up to an angle.
double air_potential(const Throttle& p, double angle_rad) {
  const int pieces = 400;
  const double from = rad(p.closed_deg);
  const double width = (angle_rad - from) / pieces;
  double sum = 0.0;
  for (int i = 0; i < pieces; ++i)
    sum -= airflow_torque_nm(p, deg(from + (i + 0.5) * width)) * width;
  return sum;
}

/// Work of each torque as it was booked, and what it should have been.
struct Ledger {
  double motor = 0.0, viscous = 0.0, friction = 0.0, spring = 0.0, stop = 0.0, air = 0.0;
  double electrical = 0.0, copper = 0.0, emf = 0.0, path = 0.0, viscous_loss = 0.0, stop_loss = 0.0, blown = 0.0;
};

void drive(DrivenThrottle& t, double time) {
  const double phase = 2.0 * std::numbers::pi * (0.4 * time + 0.3 * time * time);
  t.input.duty = 0.10 + 0.55 * std::sin(phase);
  t.input.supply_v = 12.0 + 2.0 * std::sin(3.0 * time);
  t.input.airflow_torque_nm = 0.06 * std::cos(5.0 * time);
}

double volts(const DrivenThrottle& t) {
  const double left = std::fmax(std::abs(t.input.duty) - t.parameters.dead_band, 0.0);
  return (t.input.duty < 0.0 ? -left : left) * (t.input.supply_v - t.parameters.driver_drop_v);
}

TEST(PlantEnergy, EveryTorqueOfOneMassDoesItsOwnWork) {
  const Throttle p = asymmetric_throttle();
  DrivenThrottle t(p, 45.0, step_s);
  Ledger is;
  double lowest = 90.0, highest = 0.0;
  for (int k = 0; k * step_s < run_s; ++k) {
    drive(t, k * step_s);
    const ThrottleState old = t.state;
    ThrottleTorques torques;
    t.plant.step(t.state, t.input, torques);
    const double way = t.state.angle_rad - old.angle_rad;
    const double w = t.state.speed_rad_per_s;
    const double i = t.state.current_a;
    is.motor += torques.motor_nm * way;
    is.viscous += torques.viscous_nm * way;
    is.friction += torques.friction_nm * way;
    is.spring += torques.spring_nm * way;
    is.stop += torques.stop_nm * way;
    is.air += torques.air_nm * way;
    is.electrical += volts(t) * i * step_s;
    is.copper += (p.resistance_ohm + p.driver_resistance_ohm) * i * i * step_s;
    is.emf += p.back_emf_vs_per_rad * w * i * step_s;
    is.path += std::abs(way);
    is.viscous_loss += p.viscous_nms_per_rad * w * w * step_s;
    if (into_stop(p, old.angle_rad) > 0.0) is.stop_loss += p.stop_damping_nms_per_rad * w * w * step_s;
    is.blown += t.input.airflow_torque_nm * way;
    lowest = std::fmin(lowest, t.angle_deg());
    highest = std::fmax(highest, t.angle_deg());
  }
  ASSERT_LT(lowest, p.closed_deg);
  ASSERT_GT(highest, p.open_deg);
  const double end = t.state.angle_rad;
  const double kinetic = 0.5 * p.inertia_kgm2 * t.state.speed_rad_per_s * t.state.speed_rad_per_s;
  const double magnetic = 0.5e-3 * p.inductance_mh * t.state.current_a * t.state.current_a;
  const auto near = [](double found, double expected, double share, const char* what) {
    EXPECT_NEAR(found, expected, share * std::abs(expected)) << what;
    EXPECT_GT(std::abs(expected), 1e-3) << what << " did nothing worth a test";
  };
  near(is.electrical, is.copper + is.emf + magnetic, 1e-3, "source");
  near(is.motor, is.emf * p.torque_constant_nm_per_a / p.back_emf_vs_per_rad, 1e-9, "motor");
  near(is.viscous, is.viscous_loss, 1e-9, "viscous");
  near(is.friction, p.coulomb_nm * is.path, 1e-3, "friction");
  near(is.spring, spring_potential(p, end) - spring_potential(p, rad(45.0)), 5e-3, "spring");
  const double pressed = 0.5 * p.stop_stiffness_nm_per_rad * std::pow(into_stop(p, end), 2);
  near(-is.stop, is.stop_loss + pressed, 2e-2, "stop");
  near(is.air - is.blown, air_potential(p, rad(45.0)) - air_potential(p, end), 1e-2, "air flow");
  EXPECT_NEAR(is.motor - is.viscous - is.friction - is.spring + is.stop + is.air, kinetic, 5e-3 * is.motor);
}

}  // namespace
}  // namespace mgdd::throttle
