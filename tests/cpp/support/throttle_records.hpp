// Simulated throttle logs of the identification tests: chirp and random steps through the plant, a noisy 12-bit sensor.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "mgdd/throttle/simulation.hpp"

namespace mgdd::test_support {

using Signal = std::vector<double>;

struct ThrottleLog {
  Signal duty, true_deg, angle_deg;
};

/// P1 with a higher breakaway level, or with `stiff_spring` the throttle of the stiff spring (P2).
inline throttle::Throttle log_throttle(bool stiff_spring = false) {
  throttle::Throttle t;
  t.friction = throttle::Friction::stribeck;
  t.stiction_nm = 0.30;
  if (stiff_spring) {
    t.spring_above_nm_per_rad = t.spring_below_nm_per_rad = 0.819;
    t.preload_above_nm = t.preload_below_nm = 0.20;
    t.coulomb_nm = 0.10;
    t.stiction_nm = 0.11;
  }
  return t;
}

/// Linear chirp at 1 kHz.
inline Signal chirp(double offset, double amplitude, double f0_hz, double f1_hz, double duration_s) {
  Signal u(static_cast<std::size_t>(std::lround(duration_s * 1000.0)));
  for (std::size_t k = 0; k < u.size(); ++k) {
    const double t = 1e-3 * static_cast<double>(k);
    u[k] = offset +
           amplitude * std::sin(2.0 * std::numbers::pi * (f0_hz * t + (f1_hz - f0_hz) * t * t / (2.0 * duration_s)));
  }
  return u;
}

/// N(0, 0.03 deg) and 90/4096 deg quantisation.
inline Signal sensed(const Signal& angle_deg, unsigned seed, double sigma_deg = 0.03) {
  std::mt19937 bits(seed);
  std::normal_distribution<double> noise(0.0, sigma_deg);
  Signal out = angle_deg;
  for (double& a : out)
    a = std::round((a + noise(bits)) / (90.0 / 4096.0)) * (90.0 / 4096.0);
  return out;
}

inline ThrottleLog throttle_log(const throttle::Throttle& t, const Signal& duty, unsigned seed,
                                double start_deg = 8.0) {
  ThrottleLog log{duty, Signal(duty.size()), {}};
  const throttle::ThrottlePlant plant(t);
  auto state = throttle::at_rest(start_deg);
  throttle::simulate(plant, {.duty = duty}, 10, state, {.angle_deg = log.true_deg});
  log.angle_deg = sensed(log.true_deg, seed);
  return log;
}

inline double fit_percent(const Signal& measured, const Signal& model) {
  double mean = 0.0;
  for (const double y : measured)
    mean += y / static_cast<double>(measured.size());
  double error = 0.0;
  double spread = 0.0;
  for (std::size_t k = 0; k < measured.size(); ++k) {
    error += (measured[k] - model[k]) * (measured[k] - model[k]);
    spread += (measured[k] - mean) * (measured[k] - mean);
  }
  return 100.0 * (1.0 - std::sqrt(error / spread));
}

}  // namespace mgdd::test_support
