// Figures of a run on tracks made by hand, the loop's delay and disturbances, refusals, and many loops at once.
#include "mgdd/loop/throttle_loop.hpp"

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/control/pid.hpp"
#include "mgdd/loop/throttle_controllers.hpp"

namespace mgdd::loop {
namespace {

/// Sends what it was told to, whatever it sees.
struct Recorded {
  std::vector<double> duties;
  std::size_t next = 0;
  double step(double, double) noexcept { return duties[next++]; }
};

ThrottleScenario step_scenario(double from_deg, double to_deg, std::size_t before, std::size_t after) {
  ThrottleScenario s;
  s.reference_deg.assign(before, from_deg);
  s.reference_deg.insert(s.reference_deg.end(), after, to_deg);
  s.from = before;
  return s;
}

TEST(TrackingFigures, OfATrackMadeByHand) {
  const ThrottleScenario s = step_scenario(30.0, 20.0, 100, 1000);
  ThrottleTrack track;
  track.angle_deg.assign(1100, 30.0);
  track.duty.assign(1100, 0.1);
  for (std::size_t k = 100; k < 1100; ++k)  // 40 samples late, 1 deg too far for 10 samples, then 0.1 deg off
    track.angle_deg[k] = k < 140 ? 30.0 : k < 150 ? 19.0 : 20.1;
  track.duty[100] = -0.4;
  track.duty[101] = 0.1;
  const TrackingFigures f = tracking_figures(s, track, 1e-3, 0.2);
  EXPECT_EQ(f.settling_ms, 50.0);
  EXPECT_NEAR(f.mse_deg2, (40.0 * 100.0 + 10.0 + 950.0 * 0.01) / 1000.0, 1e-9);
  EXPECT_NEAR(f.static_error_deg, 0.1, 1e-9);
  EXPECT_NEAR(f.overshoot_deg, 1.0, 1e-12);
  EXPECT_NEAR(f.total_variation, 1.0, 1e-12);
  EXPECT_NEAR(f.largest_error_deg, 10.0, 1e-12);
  EXPECT_EQ(f.limit_cycle_deg, 0.0);
  track.angle_deg.back() = 21.0;
  const TrackingFigures late = tracking_figures(s, track, 1e-3, 0.2);
  EXPECT_TRUE(std::isnan(late.settling_ms));
  EXPECT_NEAR(late.limit_cycle_deg, 0.9, 1e-12);
}

// At 1 kHz a number of samples is the same number of milliseconds, to the last digit.
TEST(TrackingFigures, SettlingIsAWholeNumberOfSamples) {
  const ThrottleScenario s = step_scenario(30.0, 20.0, 10, 300);
  ThrottleTrack track;
  track.angle_deg.assign(310, 20.0);
  track.duty.assign(310, 0.1);
  for (std::size_t samples = 1; samples < 300; ++samples) {
    track.angle_deg[9 + samples] = 30.0;  // the last one outside the band
    const auto expected = static_cast<double>(samples);
    ASSERT_EQ(tracking_figures(s, track, 1e-3, 0.2).settling_ms, expected);
    ASSERT_EQ(tracking_figures(s, track, 2e-3, 0.2).settling_ms, 2.0 * expected);
  }
}

TEST(TrackingFigures, AMovingReferenceHasNoLimitCycle) {
  ThrottleScenario s;
  for (int k = 0; k < 600; ++k)
    s.reference_deg.push_back(40.0 + std::sin(0.01 * k));
  ThrottleTrack track;
  track.angle_deg = s.reference_deg;
  track.duty.assign(600, 0.2);
  const TrackingFigures f = tracking_figures(s, track, 1e-3, 0.2);
  EXPECT_EQ(f.limit_cycle_deg, 0.0);
  EXPECT_EQ(f.settling_ms, 0.0);
  EXPECT_EQ(f.overshoot_deg, 0.0);
}

TEST(ThrottleLoop, ADutyActsBehindItsDelayAndDisturbancesActAtOnce) {
  VirtualThrottleSettings plant;
  plant.start_deg = 40.0;
  const ThrottleScenario quiet = step_scenario(40.0, 40.0, 1, 29);
  std::vector<double> duties(30, 0.17);
  duties[0] = 0.9;
  Recorded first{duties}, later{duties};
  const ThrottleTrack now = run_throttle_loop(first, plant, 0, quiet),
                      behind = run_throttle_loop(later, plant, 2, quiet);
  EXPECT_GT(now.angle_deg[0], 40.0);
  EXPECT_LT(behind.angle_deg[1], 40.0);
  EXPECT_GT(behind.angle_deg[3], behind.angle_deg[2]);
  ThrottleScenario windy = quiet, weak = quiet;
  windy.airflow_torque_nm.assign(30, 0.0);
  windy.airflow_torque_nm[20] = -3.0;
  weak.supply_v.assign(30, 12.0);
  weak.supply_v[0] = 6.0;
  Recorded third{duties}, fourth{duties};
  const ThrottleTrack blown = run_throttle_loop(third, plant, 0, windy),
                      sagged = run_throttle_loop(fourth, plant, 0, weak);
  EXPECT_EQ(blown.angle_deg[19], now.angle_deg[19]);
  EXPECT_LT(blown.angle_deg[20], now.angle_deg[20]);
  EXPECT_LT(sagged.current_a[0], 0.6 * now.current_a[0]);
}

TEST(ThrottleLoop, RefusesByName) {
  const auto refused = [](auto change, int delay = 1) {
    ThrottleScenario s = step_scenario(20.0, 30.0, 10, 10);
    change(s);
    control::Pid pid{control::PidSettings{}};
    try {
      run_throttle_loop(pid, {}, delay, s);
    } catch (const Error& e) {
      return e.field;
    }
    return std::string("nothing");
  };
  EXPECT_EQ(refused([](auto& s) { s.reference_deg.clear(); }), "reference_deg");
  EXPECT_EQ(refused([](auto& s) { s.reference_deg[3] = std::nan(""); }), "reference_deg");
  EXPECT_EQ(refused([](auto& s) { s.airflow_torque_nm = {1.0}; }), "airflow_torque_nm");
  EXPECT_EQ(refused([](auto& s) { s.supply_v.assign(20, INFINITY); }), "supply_v");
  EXPECT_EQ(refused([](auto& s) { s.from = 20; }), "from");
  EXPECT_EQ(refused([](auto&) {}, 21), "delay_samples");
  EXPECT_EQ(refused([](auto&) {}), "nothing");
}

TEST(ThrottleMonteCarlo, IsTheSameOnAnyNumberOfThreadsAndLeavesItsControllersAlone) {
  ThrottleMonteCarlo plan;
  for (int i = 0; i < 3; ++i) {
    VirtualThrottleSettings plant;
    plant.throttle.coulomb_nm = plant.throttle.stiction_nm = 0.25 + 0.03 * i;
    plant.seed = static_cast<std::uint64_t>(i);
    plan.plants.push_back(plant);
  }
  plan.controllers = {control::GuidedPredictive{control::GuidedPredictiveSettings{}},
                      control::Pid{control::PidSettings{}}};
  plan.scenarios = {step_scenario(20.0, 60.0, 200, 400), step_scenario(40.0, 42.0, 200, 400)};
  plan.band_deg = {0.8, 0.2};
  plan.threads = 1;
  const auto alone = monte_carlo(plan, {});
  plan.threads = 3;
  const auto together = monte_carlo(plan, {});
  ASSERT_EQ(alone.figures.size(), 12u);
  for (std::size_t i = 0; i < alone.figures.size(); ++i) {
    EXPECT_TRUE(alone.finished[i] && together.finished[i]);
    EXPECT_EQ(alone.figures[i].mse_deg2, together.figures[i].mse_deg2);
  }
  // [plant][controller][scenario]: a step of 2 deg costs less than one of 40.
  EXPECT_LT(alone.figures[1].mse_deg2, 0.1 * alone.figures[0].mse_deg2);
  control::Pid pid{control::PidSettings{}};
  VirtualThrottleSettings last = plan.plants[2];
  last.start_deg = 40.0;
  const ThrottleTrack track = run_throttle_loop(pid, last, 1, plan.scenarios[1]);
  EXPECT_EQ(alone.figures[11].mse_deg2, tracking_figures(plan.scenarios[1], track, 1e-3, 0.2).mse_deg2);
  plan.band_deg.pop_back();
  EXPECT_THROW(monte_carlo(plan, {}), ShapeError);
  plan.plants.clear();
  EXPECT_THROW(monte_carlo(plan, {}), ParameterError);
}

}  // namespace
}  // namespace mgdd::loop
