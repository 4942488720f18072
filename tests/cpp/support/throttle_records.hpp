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

inline Signal golden_steps(double duration_s) {
  Signal u(static_cast<std::size_t>(std::lround(duration_s * 1000.0)));
  for (std::size_t k = 0; k < u.size(); ++k) {
    const double z = 0.6180339887 * static_cast<double>(k / 150);
    u[k] = 0.15 + 0.20 * (2.0 * (z - std::floor(z)) - 1.0);
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

/// RMS of y_measured(k) + sim(k + horizon) - sim(k) against the true angle.
inline double ahead_rms(const ThrottleLog& log, const Signal& model, std::size_t horizon) {
  double sum = 0.0;
  const std::size_t n = model.size() - horizon;
  for (std::size_t k = 0; k < n; ++k) {
    const double e = log.angle_deg[k] + model[k + horizon] - model[k] - log.true_deg[k + horizon];
    sum += e * e;
  }
  return std::sqrt(sum / static_cast<double>(n));
}

}  // namespace mgdd::test_support
