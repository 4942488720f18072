// Throttle presets, what a controller knows of them, and the tuned sets of the design study for PID and sliding mode.
#pragma once

#include <array>

#include "mgdd/common/units.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/control/sliding_mode.hpp"
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

}  // namespace mgdd::test_support
