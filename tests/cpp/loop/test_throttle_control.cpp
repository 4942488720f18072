// PID and sliding mode on the virtual throttle: the tuned parameters of the design study on the presets P1, P2 and P3,
// beside the figures that the study found with another program on 100 plants drawn within 20 % of each preset.
// Protocol: the angle is measured with 0.03 deg of noise and 12 bits, a duty acts one sample after it was computed,
// 0.5 s at the old reference, 0.6 s after the step; MSE and settling of the true angle, medians over 11 seeds.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <ostream>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/units.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/control/sliding_mode.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "support/throttle_presets.hpp"

namespace mgdd::loop {
namespace {

using control::Pid;
using control::PidSettings;
using control::ReachingLaw;
using control::SlidingMode;
using control::SlidingModeSettings;
using test_support::preset;
using throttle::Throttle;

/// What a controller knows of its plant.
struct Groups {
  double time_constant_s, gain_deg_per_s2, coulomb;
  control::HoldingDuty spring;

  explicit Groups(const Throttle& t)
      : time_constant_s(t.inertia_kgm2 / t.damping_nms_per_rad()),
        gain_deg_per_s2(t.stall_torque_nm() / t.inertia_kgm2 / units::rad_per_deg),
        coulomb(t.coulomb_nm / t.stall_torque_nm()) {
    const control::SpringSideDuty side{t.preload_above_nm / t.stall_torque_nm(),
                                       t.spring_above_nm_per_rad * units::rad_per_deg / t.stall_torque_nm()};
    spring = {.limp_home_deg = t.limp_home_deg, .ramp_deg = 0.5, .above = side, .below = side};
  }
};

/// Kp, Ki, Kd in duty % per travel %, kick per Coulomb friction, its width, integral window, dead band, rate and
/// friction feed-forward per their values in the model.
using PidRow = std::array<double, 9>;
PidSettings pid_of(const Groups& g, const PidRow& row) {
  PidSettings s;
  s.above = s.below = {row[0] / 90.0, row[1] / 90.0, row[2] / 90.0};
  s.spring = g.spring;
  s.kick = row[3] * g.coulomb;
  s.kick_width_deg = row[4];
  s.integral_window_deg = row[5];
  s.dead_band_deg = row[6];
  s.rate_s_per_deg = row[7] / (g.time_constant_s * g.gain_deg_per_s2);
  s.friction = row[8] * g.coulomb;
  return s;
}

/// Switching duty, layer [rad], integral, bandwidth, pole of the reference, friction feed-forward, integral layers.
using SlidingRow = std::array<double, 7>;
SlidingModeSettings sliding_mode_of(const Groups& g, const SlidingRow& row, ReachingLaw law) {
  SlidingModeSettings s;
  s.reaching = law;
  s.gain_deg_per_s2 = g.gain_deg_per_s2;
  s.time_constant_s = g.time_constant_s;
  s.spring = g.spring;
  s.switching = row[0];
  s.layer_deg = row[1] / units::rad_per_deg;
  s.integral_per_s = row[2];
  s.bandwidth_per_s = row[3];
  s.reference_pole_per_s = row[4];
  s.friction = row[5] * g.coulomb;
  s.integral_layers = row[6];
  return s;
}

struct Figures {
  double settling_ms, mse_deg2;
};

/// The loop of the protocol over a reference, from rest at its first value; `look(k, error)` sees the true error.
template <class Controller, class Reference, class Look>
void track(Controller controller, const Throttle& t, std::uint64_t seed, int samples, Reference reference, Look look) {
  VirtualThrottleSettings s;
  s.throttle = t;
  s.start_deg = reference(0);
  s.seed = seed;
  s.sensors.noise_v = 0.03 * s.sensors.span_v / s.sensors.travel_deg;
  s.sensors.lag_s = 0.0;
  VirtualThrottle bench(s);
  double measured = s.start_deg, acting = 0.0;
  for (int k = 0; k < samples; ++k) {
    const double computed = controller.step(reference(k), measured);
    const VirtualThrottleSample now = bench.step({acting, t.supply_v, 0.0});
    acting = computed;
    measured = now.sensed.angle_deg;
    look(k, reference(k) - now.angle_deg);
  }
}

double median(std::vector<double> values) {
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

template <class Controller>
Figures stepped(const Controller& controller, const Throttle& t, double from_deg, double to_deg) {
  constexpr int before = 500, after = 600, seeds = 11;
  const double band = std::max(0.02 * std::abs(to_deg - from_deg), 0.2);
  std::vector<double> settling, mse;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    double last = 0.0, squares = 0.0;
    track(
        controller, t, seed, before + after, [&](int k) { return k < before ? from_deg : to_deg; },
        [&](int k, double error) {
          if (k < before) return;
          squares += error * error;
          if (std::abs(error) > band) last = k + 1 - before;
        });
    settling.push_back(last);
    mse.push_back(squares / after);
  }
  return {median(settling), median(mse)};
}

template <class Controller>
double sine_mse_deg2(const Controller& controller, const Throttle& t) {
  double squares = 0.0;
  track(
      controller, t, 0, 6000, [](int k) { return 40.0 + 10.0 * std::sin(2.0 * std::numbers::pi * 1e-3 * k); },
      [&](int k, double error) {
        if (k >= 1000) squares += error * error;
      });
  return squares / 5000.0;
}

struct Case {
  int preset;
  PidRow pid;
  SlidingRow sliding;
  // Medians of the study: settling 20->60, settling 40->42, MSE 40->42, MSE of the sine.
  std::array<double, 4> pid_study, sliding_study;
  // What this program finds: settling and MSE 20->60, settling and MSE 40->42, MSE of the sine.
  std::array<double, 5> pid_here, sliding_here;

  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << 'P' << c.preset; }
};

class TunedThrottle : public testing::TestWithParam<Case> {};

template <class Controller>
void expect_figures(const Controller& controller, const Throttle& t, const std::array<double, 4>& study,
                    const std::array<double, 5>& here) {
  const Figures large = stepped(controller, t, 20.0, 60.0), small = stepped(controller, t, 40.0, 42.0);
  const double sine = sine_mse_deg2(controller, t);
  EXPECT_NEAR(large.settling_ms, here[0], 3.0);
  EXPECT_NEAR(large.mse_deg2, here[1], 0.01 * here[1]);
  EXPECT_NEAR(small.settling_ms, here[2], 2.0);
  EXPECT_NEAR(small.mse_deg2, here[3], 0.03 * here[3]);
  EXPECT_NEAR(sine, here[4], 0.1 * here[4]);
  // The nominal plant is easier than the median of those drawn around it, so never slower than the study.
  EXPECT_LT(large.settling_ms, 1.05 * study[0]);
  EXPECT_LT(small.settling_ms, 1.05 * study[1]);
  EXPECT_NEAR(small.mse_deg2, study[2], 0.1 * study[2]);
  EXPECT_NEAR(sine, study[3], 0.25 * study[3]);
}

TEST_P(TunedThrottle, PidDoesWhatTheStudyFound) {
  const Throttle t = preset(GetParam().preset);
  expect_figures(Pid(pid_of(Groups(t), GetParam().pid)), t, GetParam().pid_study, GetParam().pid_here);
}

TEST_P(TunedThrottle, SlidingModeDoesWhatTheStudyFound) {
  const Throttle t = preset(GetParam().preset);
  const auto with = [&](ReachingLaw law) { return SlidingMode(sliding_mode_of(Groups(t), GetParam().sliding, law)); };
  expect_figures(with(ReachingLaw::boundary_layer), t, GetParam().sliding_study, GetParam().sliding_here);
  const Figures implicit = stepped(with(ReachingLaw::implicit), t, 40.0, 42.0);
  EXPECT_NEAR(implicit.mse_deg2, GetParam().sliding_here[3], 0.1 * GetParam().sliding_here[3]);
}

INSTANTIATE_TEST_SUITE_P(ThrottleControl, TunedThrottle,
                         testing::Values(Case{1,
                                              {11.5, 117.0, 0.132, 1.3, 0.019, 2.0, 0.1, 0.57, 0.65},
                                              {0.793, 0.0604, 3.03, 136.0, 170.0, 0.82, 3.0},
                                              {74.0, 24.0, 0.064, 0.028},
                                              {100.0, 25.0, 0.055, 0.253},
                                              {73.0, 65.2, 18.0, 0.064, 0.0237},
                                              {92.0, 74.8, 13.0, 0.052, 0.308}},
                                         Case{2,
                                              {11.0, 49.4, 0.117, 1.3, 0.216, 2.0, 0.0, 0.55, 0.99},
                                              {0.238, 0.0248, 4.46, 85.0, 147.0, 1.2, 1.0},
                                              {69.0, 23.0, 0.065, 0.052},
                                              {193.0, 18.0, 0.048, 0.25},
                                              {64.0, 62.4, 19.0, 0.068, 0.0522},
                                              {139.0, 97.3, 14.0, 0.052, 0.293}},
                                         Case{3,
                                              {15.8, 15.0, 0.147, 1.3, 0.097, 1.0, 0.0, 1.3, 1.3},
                                              {0.855, 0.0564, 21.2, 119.0, 185.0, 1.2, 0.5},
                                              {75.0, 25.0, 0.068, 0.006},
                                              {135.0, 18.0, 0.044, 0.155},
                                              {69.0, 80.8, 23.0, 0.068, 0.0070},
                                              {138.0, 81.6, 15.0, 0.044, 0.160}}));

TEST(ThrottleControl, TheDefaultsAreTheTunedSetOfP1) {
  const Groups g(preset(1));
  const PidSettings tuned = pid_of(g, {11.5, 117.0, 0.132, 1.3, 0.019, 2.0, 0.1, 0.57, 0.65});
  for (const auto& field : control::pid_fields())
    EXPECT_NEAR(field.in(PidSettings{}), field.in(tuned), 2e-3 * std::abs(field.in(tuned))) << field.info.name;
  const SlidingModeSettings sliding =
      sliding_mode_of(g, {0.793, 0.0604, 3.03, 136.0, 170.0, 0.82, 3.0}, ReachingLaw::implicit);
  for (const auto& field : control::sliding_mode_fields()) {
    EXPECT_NEAR(field.in(SlidingModeSettings{}), field.in(sliding), 2e-3 * std::abs(field.in(sliding)))
        << field.info.name;
  }
}

}  // namespace
}  // namespace mgdd::loop
