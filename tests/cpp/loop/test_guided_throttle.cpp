// The guided predictive controller on the virtual throttle: facts of the plain form on P1, and what the default does on
// throttles that it does not know. Protocol: 0.03 deg of noise, 12 bits, a duty acts one sample after it was computed.
#include <ostream>

#include "mgdd/loop/throttle_controllers.hpp"
#include "support/test.hpp"
#include "support/throttle_presets.hpp"

namespace mgdd::loop {
namespace {

using control::GuidedPredictive;
using control::GuidedPredictiveSettings;
using test_support::drawn;
using test_support::preset;
using throttle::plate_of;

GuidedPredictiveSettings learning(int number) {
  GuidedPredictiveSettings s;
  s.plate = plate_of(preset(number));
  return s;
}
GuidedPredictiveSettings plain(double trim_rate = 0.3) {
  GuidedPredictiveSettings s = learning(1);
  s.friction_learning = false;
  s.move_steps = {4, 6, 10};
  s.duty_change_weight = 20.0;
  s.observer_speed_per_s2 = 43218.0;
  s.trim_rate_per_deg_s = trim_rate;
  return s;
}

VirtualThrottleSettings plant_of(const throttle::Throttle& t, std::uint64_t seed = 0) {
  VirtualThrottleSettings s;
  s.throttle = t;
  s.seed = seed;
  s.sensors.noise_v = 0.03 * s.sensors.span_v / s.sensors.travel_deg;
  s.sensors.lag_s = 0.0;
  return s;
}

ThrottleScenario step_scenario(double from_deg, double to_deg, std::size_t after = 600) {
  ThrottleScenario s;
  s.reference_deg.assign(500, from_deg);
  s.reference_deg.insert(s.reference_deg.end(), after, to_deg);
  s.from = 500;
  return s;
}
ThrottleScenario sine_scenario(double mean_deg, double amplitude_deg) {
  ThrottleScenario s;
  for (int k = 0; k < 6000; ++k)
    s.reference_deg.push_back(mean_deg + amplitude_deg * std::sin(2e-3 * std::numbers::pi * k));
  s.from = 1000;
  return s;
}

template <class Controller>
ThrottleTrack run(Controller controller, const throttle::Throttle& t, const ThrottleScenario& s, int delay = 1) {
  VirtualThrottleSettings plant = plant_of(t);
  plant.start_deg = s.reference_deg.front();
  return run_throttle_loop(controller, plant, delay, s);
}
template <class Controller>
TrackingFigures judged(const Controller& controller, const throttle::Throttle& t, const ThrottleScenario& s,
                       double band_deg, int delay = 1) {
  return tracking_figures(s, run(controller, t, s, delay), 1e-3, band_deg);
}

// Time from the step until 90 % of it are passed [ms].
double rise_ms(const ThrottleTrack& track, const ThrottleScenario& s) {
  const double from = s.reference_deg.front(), to = s.reference_deg.back();
  std::size_t k = s.from;
  while (k < track.angle_deg.size() && std::abs(track.angle_deg[k] - from) < 0.9 * std::abs(to - from))
    ++k;
  return static_cast<double>(k + 1 - s.from);
}

TEST(GuidedThrottle, ThePlainFormMeetsTheFactsOfP1) {
  const GuidedPredictive controller(plain());
  const ThrottleScenario large = step_scenario(20.0, 60.0), largest = step_scenario(8.0, 80.0);
  const ThrottleTrack track = run(controller, preset(1), large);
  const TrackingFigures f = tracking_figures(large, track, 1e-3, 0.8);
  EXPECT_LE(rise_ms(track, large), 55.0);
  EXPECT_LE(f.settling_ms, 80.0);
  EXPECT_LE(f.overshoot_deg, 1.5);
  for (const double duty : track.duty)
    EXPECT_LE(std::abs(duty), 1.0);
  EXPECT_LE(judged(controller, preset(1), step_scenario(40.0, 42.0), 0.2).settling_ms, 60.0);
  EXPECT_LE(judged(controller, preset(1), step_scenario(4.0, 20.0), 0.32).settling_ms, 80.0);
  EXPECT_LE(judged(controller, preset(1), step_scenario(20.0, 4.0), 0.32).settling_ms, 80.0);
  EXPECT_LE(rise_ms(run(controller, preset(1), largest), largest), 78.0);
  EXPECT_LE(judged(controller, preset(1), largest, 1.44).settling_ms, 95.0);
}

TEST(GuidedThrottle, TrimAndBiasRemoveTheErrorOfASteadyTorque) {
  ThrottleScenario s = step_scenario(30.0, 70.0, 3000);
  s.airflow_torque_nm.assign(s.reference_deg.size(), -0.3);
  const auto error = [&](const GuidedPredictiveSettings& settings) {
    return judged(GuidedPredictive(settings), preset(1), s, 0.8).static_error_deg;
  };
  GuidedPredictiveSettings nothing = plain(0.0);
  nothing.bias_rate_per_deg_s = 0.0;
  const double both = error(plain()), bias = error(plain(0.0)), neither = error(nothing);
  EXPECT_LE(both, 0.10);
  EXPECT_LT(both, bias);
  EXPECT_LT(bias, neither);
  EXPECT_LE(error(learning(1)), 0.13);
}

struct Bars {
  int preset;
  double large_ms, large_p95_ms, crossing_ms, crossing_p95_ms;
  friend std::ostream& operator<<(std::ostream& out, const Bars& b) { return out << 'P' << b.preset; }
};
class UnknownThrottles : public testing::TestWithParam<Bars> {};

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

// One hundred throttles within 20 % of the preset, of which the controller knows the preset only.
TEST_P(UnknownThrottles, AreTrackedWithinTheBars) {
  const Bars bars = GetParam();
  ThrottleMonteCarlo plan;
  for (std::uint64_t i = 0; i < 100; ++i)
    plan.plants.push_back(plant_of(drawn(preset(bars.preset), 0.2, 500 + i), i));
  plan.controllers = {GuidedPredictive(learning(bars.preset))};
  plan.scenarios = {step_scenario(20.0, 60.0), step_scenario(40.0, 42.0), step_scenario(4.0, 20.0),
                    step_scenario(20.0, 4.0),  sine_scenario(40.0, 10.0), step_scenario(30.0, 40.0, 3000)};
  plan.scenarios.back().from = 1500;  // at rest for one second
  plan.band_deg = {0.8, 0.2, 0.32, 0.32, 0.2, 0.2};
  plan.threads = 2;
  const auto result = monte_carlo(plan, {});
  const auto all = [&](std::size_t scenario, double TrackingFigures::* figure) {
    std::vector<double> values;
    for (std::size_t i = scenario; i < result.figures.size(); i += plan.scenarios.size()) {
      const double value = result.figures[i].*figure;
      values.push_back(std::isnan(value) ? 1e9 : value);
    }
    return values;
  };
  const auto expect = [](const std::vector<double>& values, double median, double p95) {
    EXPECT_LE(quantile(values, 0.5), median);
    EXPECT_LE(quantile(values, 0.95), p95);
  };
  using F = TrackingFigures;
  expect(all(0, &F::settling_ms), bars.large_ms, bars.large_p95_ms);
  expect(all(1, &F::settling_ms), 25.0, 45.0);
  expect(all(1, &F::mse_deg2), 0.060, 0.080);
  expect(all(2, &F::settling_ms), bars.crossing_ms, bars.crossing_p95_ms);
  expect(all(3, &F::settling_ms), bars.crossing_ms, bars.crossing_p95_ms);
  expect(all(4, &F::mse_deg2), 0.01, 0.01);
  expect(all(5, &F::total_variation), 0.2, 0.2);
  for (std::size_t scenario = 0; scenario < 4; ++scenario) {
    EXPECT_LE(quantile(all(scenario, &F::static_error_deg), 0.95), 0.12);
    EXPECT_LT(quantile(all(scenario, &F::limit_cycle_deg), 1.0), 0.5);
  }
  EXPECT_LT(quantile(all(5, &F::limit_cycle_deg), 1.0), 0.5);
}

INSTANTIATE_TEST_SUITE_P(GuidedThrottle, UnknownThrottles,
                         testing::Values(Bars{1, 70.0, 100.0, 50.0, 75.0}, Bars{2, 70.0, 100.0, 50.0, 75.0},
                                         Bars{3, 88.0, 110.0, 72.0, 85.0}));

}  // namespace
}  // namespace mgdd::loop
