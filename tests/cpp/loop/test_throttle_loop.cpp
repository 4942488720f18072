// Figures of a run on tracks made by hand, the loop's delay and disturbances.
#include "mgdd/loop/throttle_loop.hpp"

#include <cmath>
#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace mgdd::loop
