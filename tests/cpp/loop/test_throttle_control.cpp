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

#include "mgdd/control/pid.hpp"
#include "mgdd/control/sliding_mode.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "support/tuned_throttle.hpp"

namespace mgdd::loop {
namespace {

using namespace test_support;
using control::Pid;
using control::SlidingMode;

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
  TunedSet tuned;
  // Medians of the study: settling 20->60, settling 40->42, MSE 40->42, MSE of the sine.
  std::array<double, 4> pid_study, sliding_study;

  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << 'P' << c.tuned.preset; }
};

class TunedThrottle : public testing::TestWithParam<Case> {};

template <class Controller>
void expect_figures(const Controller& controller, const Throttle& t, const std::array<double, 4>& study) {
  const Figures large = stepped(controller, t, 20.0, 60.0), small = stepped(controller, t, 40.0, 42.0);
  const double sine = sine_mse_deg2(controller, t);
  // The nominal plant is easier than the median of those drawn around it, so never slower than the study.
  EXPECT_LT(large.settling_ms, 1.05 * study[0]);
  EXPECT_LT(small.settling_ms, 1.05 * study[1]);
  EXPECT_NEAR(small.mse_deg2, study[2], 0.1 * study[2]);
  EXPECT_NEAR(sine, study[3], 0.25 * study[3]);
}

TEST_P(TunedThrottle, PidDoesWhatTheStudyFound) {
  const Throttle t = preset(GetParam().tuned.preset);
  expect_figures(Pid(pid_of(plate_of(t), GetParam().tuned.pid)), t, GetParam().pid_study);
}

TEST_P(TunedThrottle, SlidingModeDoesWhatTheStudyFound) {
  const Throttle t = preset(GetParam().tuned.preset);
  const auto with = [&](ReachingLaw law) {
    return SlidingMode(sliding_mode_of(plate_of(t), GetParam().tuned.sliding, law));
  };
  expect_figures(with(ReachingLaw::boundary_layer), t, GetParam().sliding_study);
  const Figures implicit = stepped(with(ReachingLaw::implicit), t, 40.0, 42.0);
  EXPECT_NEAR(implicit.mse_deg2, GetParam().sliding_study[2], 0.2 * GetParam().sliding_study[2]);
}

INSTANTIATE_TEST_SUITE_P(ThrottleControl, TunedThrottle,
                         testing::Values(Case{tuned_sets[0], {74.0, 24.0, 0.064, 0.028}, {100.0, 25.0, 0.055, 0.253}},
                                         Case{tuned_sets[1], {69.0, 23.0, 0.065, 0.052}, {193.0, 18.0, 0.048, 0.25}},
                                         Case{tuned_sets[2], {75.0, 25.0, 0.068, 0.006}, {135.0, 18.0, 0.044, 0.155}}));

TEST(ThrottleControl, TheDefaultsAreTheTunedSetOfP1) {
  const control::Plate g = plate_of(preset(1));
  const PidSettings tuned = pid_of(g, tuned_sets[0].pid);
  for (const auto& field : control::pid_fields())
    EXPECT_NEAR(field.in(PidSettings{}), field.in(tuned), 2e-3 * std::abs(field.in(tuned))) << field.info.name;
  const SlidingModeSettings sliding = sliding_mode_of(g, tuned_sets[0].sliding, ReachingLaw::implicit);
  for (const auto& field : control::sliding_mode_fields()) {
    EXPECT_NEAR(field.in(SlidingModeSettings{}), field.in(sliding), 2e-3 * std::abs(field.in(sliding)))
        << field.info.name;
  }
}

}  // namespace
}  // namespace mgdd::loop
