// The tuned sets of the design study under a supervisor on the virtual throttle, and the driving of a healthy one:
// steps up to 80 deg, small steps, sines, both stops, limp-home crossed, with noise and air.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "mgdd/common/random.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/control/sliding_mode.hpp"
#include "mgdd/control/supervisor.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "mgdd/throttle/throttle.hpp"
#include "support/throttle_presets.hpp"

namespace mgdd::test_support {

using control::PidSettings;
using control::ReachingLaw;
using control::SlidingModeSettings;
using throttle::Throttle;

/// Kp, Ki, Kd in duty % per travel %, kick per Coulomb friction, its width, integral window, dead band, rate and
/// friction feed-forward per their values in the model.
using PidRow = std::array<double, 9>;
inline PidSettings pid_of(const control::Plate& g, const PidRow& row) {
  PidSettings s;
  s.above = s.below = {row[0] / 90.0, row[1] / 90.0, row[2] / 90.0};
  s.plate = g;
  s.kick = row[3] * g.friction;
  s.kick_width_deg = row[4];
  s.integral_window_deg = row[5];
  s.dead_band_deg = row[6];
  s.rate_s_per_deg = row[7] / (g.time_constant_s * g.gain_deg_per_s2);
  s.plate.friction = row[8] * g.friction;
  return s;
}

/// Switching duty, layer [rad], integral, bandwidth, pole of the reference, friction feed-forward, integral layers.
using SlidingRow = std::array<double, 7>;
inline SlidingModeSettings sliding_mode_of(const control::Plate& g, const SlidingRow& row, ReachingLaw law) {
  SlidingModeSettings s;
  s.reaching = law;
  s.plate = g;
  s.switching = row[0];
  s.layer_deg = row[1] / units::rad_per_deg;
  s.integral_per_s = row[2];
  s.bandwidth_per_s = row[3];
  s.reference_pole_per_s = row[4];
  s.plate.friction = row[5] * g.friction;
  s.integral_layers = row[6];
  return s;
}

struct TunedSet {
  int preset;
  PidRow pid;
  SlidingRow sliding;
};
inline constexpr std::array<TunedSet, 3> tuned_sets{{
    {1, {11.5, 117.0, 0.132, 1.3, 0.019, 2.0, 0.1, 0.57, 0.65}, {0.793, 0.0604, 3.03, 136.0, 170.0, 0.82, 3.0}},
    {2, {11.0, 49.4, 0.117, 1.3, 0.216, 2.0, 0.0, 0.55, 0.99}, {0.238, 0.0248, 4.46, 85.0, 147.0, 1.2, 1.0}},
    {3, {15.8, 15.0, 0.147, 1.3, 0.097, 1.0, 0.0, 1.3, 1.3}, {0.855, 0.0564, 21.2, 119.0, 185.0, 1.2, 0.5}},
}};

inline control::SupervisorSettings supervisor_of(const Throttle& t) {
  control::SupervisorSettings s;
  s.plate = plate_of(t);
  s.plate.friction = t.stiction_nm / t.stall_torque_nm();
  s.return_s = t.limp_home_deg > 10.0 ? 0.8 : 0.4;
  return s;
}

/// Its protocol: 0.03 deg of noise, 12 bits; a duty acts one sample after it was computed.
inline loop::VirtualThrottleSettings plant_of(const Throttle& t, double start_deg, std::uint64_t seed) {
  loop::VirtualThrottleSettings s;
  s.throttle = t;
  s.start_deg = start_deg;
  s.seed = seed;
  s.sensors.noise_v = 0.03 * s.sensors.span_v / s.sensors.travel_deg;
  s.sensors.lag_s = 0.0;
  return s;
}

/// One sample of a supervised loop.
struct SupervisedSample {
  int k = 0;
  double reference_deg = 0.0, angle_deg = 0.0, speed_deg_per_s = 0.0;
  control::SupervisorOrder order{};
};

template <class Controller>
class SupervisedLoop {
 public:
  SupervisedLoop(Controller c, const control::SupervisorSettings& s, const loop::VirtualThrottleSettings& p)
      : controller(std::move(c)), supervisor(s), plant(p), sensors_(p.sensors) {
    last_.sensed.volts = {p.sensors.closed_v + p.sensors.span_v * p.start_deg / p.sensors.travel_deg, 0.0};
    last_.sensed.volts[1] = p.sensors.supply_v - last_.sensed.volts[0];
    last_.supply_v = p.throttle.supply_v;
  }

  SupervisedSample step(double reference_deg, double airflow_torque_nm = 0.0) {
    control::SupervisorInputs in{.reference_deg = reference_deg,
                                 .angle_deg = sensors_.angles_deg(last_.sensed.volts),
                                 .age_s = last_.age_s,
                                 .supply_v = last_.supply_v,
                                 .sensor_fault = last_.sensed.fault};
    const control::SupervisorView view = supervisor.observe(in);
    const double asked = acting_.bridge_open ? 0.0 : controller.step(view.reference_deg, view.angle_deg);
    const control::SupervisorOrder order = supervisor.decide(asked);
    last_ = plant.step({acting_.duty, plant.settings().throttle.supply_v, airflow_torque_nm, acting_.bridge_open});
    acting_ = order;
    return {k_++, reference_deg, last_.angle_deg, last_.speed_deg_per_s, order};
  }
  Controller controller;
  control::ThrottleSupervisor supervisor;
  loop::VirtualThrottle plant;

 private:
  throttle::SensorPair sensors_;
  loop::VirtualThrottleSample last_{};
  control::SupervisorOrder acting_{};
  int k_ = 0;
};

inline constexpr int driving_samples = 9000;
inline double driving_deg(int k) {
  const double t = 1e-3 * k;
  constexpr double steps[] = {10.0, 90.0, 10.0, 90.0, 50.0, 52.0, 49.0, 20.0, 4.0, 20.0, 0.0, 60.0};
  if (t < 4.8) return steps[k / 400];
  if (t < 6.8) return 40.0 + 10.0 * std::sin(2.0 * std::numbers::pi * t);
  if (t < 7.8) return 40.0 + 8.0 * std::sin(6.0 * std::numbers::pi * t);
  return 8.0 + 6.0 * std::sin(2.0 * std::numbers::pi * t);  // through limp-home
}

/// -0.1 N m in turbulence of 30 % below 20 Hz, from the first second on.
class Air {
 public:
  explicit Air(std::uint64_t seed) : seed_(seed) {}
  double torque_nm(int k) {
    const double share = 1.0 - std::exp(-2.0 * std::numbers::pi * 20.0 * 1e-3);
    const double white = random::normal(seed_, 77, static_cast<std::uint64_t>(k));
    gust_ += share * (white * std::sqrt(2.0 / share - 1.0) - gust_);
    return k < 1000 ? 0.0 : -0.1 * (1.0 + 0.3 * gust_);
  }

 private:
  std::uint64_t seed_;
  double gust_ = 0.0;
};

/// A body within 20 % of another one, each of seven factors uniform.
inline Throttle near(const Throttle& t, std::uint64_t body) {
  const auto factor = [&](std::uint64_t which) { return 0.8 + 0.4 * random::uniform(2026, body, which); };
  Throttle out = t;
  out.inertia_kgm2 *= factor(0);
  out.viscous_nms_per_rad *= factor(1);
  const double motor = factor(2);
  out.torque_constant_nm_per_a *= motor;
  out.back_emf_vs_per_rad *= motor;
  out.resistance_ohm *= factor(3);
  const double spring = factor(4), preload = factor(5), friction = factor(6);
  out.spring_above_nm_per_rad *= spring;
  out.spring_below_nm_per_rad *= spring;
  out.preload_above_nm *= preload;
  out.preload_below_nm *= preload;
  out.coulomb_nm *= friction;
  out.stiction_nm *= friction;
  return out;
}

}  // namespace mgdd::test_support
