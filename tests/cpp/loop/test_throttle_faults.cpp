// Faults of the virtual throttle, and the figures of a loop around it.
#include "mgdd/loop/throttle_faults.hpp"
#include "mgdd/loop/throttle_loop.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

using Kind = ThrottleFaultKind;

VirtualThrottleSettings with(std::vector<ThrottleFault> faults, double start_deg = 12.0) {
  VirtualThrottleSettings s;
  s.start_deg = start_deg;
  s.seed = 5;
  s.plant_faults = std::move(faults);
  return s;
}

double lively_duty(int k) {
  return 0.4 * std::sin(0.02 * k) + 0.1;
}

TEST(ThrottleFaults, OneThatBeginsLaterChangesNoBitBefore) {
  for (const Kind kind : {Kind::jammed, Kind::jammed_at, Kind::spring_above, Kind::supply_sag, Kind::missing_sample,
                          Kind::nan_sample, Kind::stale_sample}) {
    const double size = kind == Kind::jammed_at ? 40.0 : kind == Kind::spring_above ? 1.0 : 0.0;
    VirtualThrottle healthy(with({})), other(with({{kind, 0.2, size, 0.55}}));
    int differing = 0;
    for (int k = 0; k < 600; ++k) {
      const auto a = healthy.step({lively_duty(k), 12.0, 0.0}), b = other.step({lively_duty(k), 12.0, 0.0});
      const bool same = a.angle_deg == b.angle_deg && a.sensed.volts == b.sensed.volts && a.age_s == b.age_s &&
                        a.supply_v == b.supply_v;
      if (k < 200) {
        ASSERT_TRUE(same) << static_cast<int>(kind) << " " << k;
      } else if (!same) {
        ++differing;
      }
    }
    EXPECT_GT(differing, 0) << static_cast<int>(kind);
  }
}

TEST(ThrottleFaults, AJammedPlateStandsUnderAnyDutyWhateverItsFrictionAndIsFreeAfterwards) {
  for (const auto friction : {throttle::Friction::coulomb, throttle::Friction::tanh, throttle::Friction::lugre}) {
    for (const auto backlash :
         {throttle::Backlash::none, throttle::Backlash::compliance, throttle::Backlash::hysteresis}) {
      VirtualThrottleSettings s = with({{Kind::jammed, 0.05, 0.0, 0.4}});
      s.throttle.friction = friction;
      s.throttle.backlash = backlash;
      s.throttle.plate_friction_share = 0.02;
      VirtualThrottle bench(s);
      VirtualThrottleSample at;
      for (int k = 0; k < 50; ++k)
        at = bench.step({0.8, 12.0, 0.0});
      ASSERT_GT(at.speed_deg_per_s, 500.0);  // in flight
      for (int k = 50; k < 400; ++k) {
        const auto now = bench.step({k % 80 < 40 ? -1.0 : 1.0, 14.0, -0.4});
        ASSERT_NEAR(now.angle_deg, at.angle_deg, 0.0) << k;
        ASSERT_EQ(now.speed_deg_per_s, 0.0);
      }
      for (int k = 0; k < 300; ++k)
        at = bench.step({1.0, 12.0, 0.0});
      EXPECT_GT(at.angle_deg, 80.0);
    }
  }
}

TEST(ThrottleFaults, AJamAtAnAngleLetsThePlateMoveUntilItComesThereFromEitherSide) {
  for (const double start : {12.0, 80.0}) {
    VirtualThrottle bench(with({{Kind::jammed_at, 0.02, 50.0}}, start));
    for (int k = 0; k < 20; ++k)
      (void)bench.step({0.14, 12.0, 0.0});
    VirtualThrottleSample now;
    for (int k = 0; k < 400; ++k)
      now = bench.step({start < 50.0 ? 0.6 : -0.6, 12.0, 0.0});
    EXPECT_NEAR(now.angle_deg, 50.0, 0.2);
    for (int k = 0; k < 400; ++k)
      now = bench.step({start < 50.0 ? -1.0 : 1.0, 12.0, 0.0});
    EXPECT_NEAR(now.angle_deg, 50.0, 0.2);
  }
}

TEST(ThrottleFaults, WithoutASpringThePlateStaysWhereTheOpenBridgeLeavesIt) {
  const auto end = [](Kind kind, double start, double size) {
    VirtualThrottle bench(with({{kind, 0.0, size}}, start));
    VirtualThrottleSample now;
    for (int k = 0; k < 1000; ++k)
      now = bench.step({0.0, 12.0, 0.0, true});
    return now.angle_deg;
  };
  EXPECT_NEAR(end(Kind::spring_above, 60.0, 1.0), 60.0, 1e-9);
  EXPECT_NEAR(end(Kind::spring_below, 1.0, 1.0), 1.0, 1e-9);
  // The whole one brings the plate to limp-home and past it, where nothing pulls it back.
  EXPECT_LT(end(Kind::spring_below, 60.0, 1.0), 7.0);
  EXPECT_GT(end(Kind::spring_above, 1.0, 1.0), 9.0);
  EXPECT_NEAR(end(Kind::spring_above, 60.0, 0.05), 8.0, 0.3);  // a tired spring still closes
}

TEST(ThrottleFaults, TheSupplySagsToItsVoltageAndALowerOneOfTheInputsStays) {
  VirtualThrottle sagging(with({{Kind::supply_sag, 0.1, 8.0}})), told(with({}));
  for (int k = 0; k < 300; ++k) {
    const double supply = k < 200 ? 12.5 : 7.0;
    const auto a = sagging.step({0.5, supply, 0.0});
    const auto b = told.step({0.5, k < 100 ? 12.5 : std::min(supply, 8.0), 0.0});
    ASSERT_EQ(a.angle_deg, b.angle_deg);
    EXPECT_EQ(a.supply_v, b.supply_v);
  }
}

TEST(ThrottleFaults, AMissingAnInvalidAndAStaleSampleAreToldApartByNumbersAndAge) {
  const double h = 1e-3;
  VirtualThrottle healthy(with({})), missing(with({{Kind::missing_sample, 0.05, 0.0, 0.055}})),
      invalid(with({{Kind::nan_sample, 0.05, 0.0, 0.055}})), stale(with({{Kind::stale_sample, 0.05, 0.0, 0.055}}));
  throttle::SensorReading last;
  for (int k = 0; k < 100; ++k) {
    const VirtualThrottleInputs in{lively_duty(k), 12.0, 0.0};
    const auto a = healthy.step(in), m = missing.step(in), n = invalid.step(in), s = stale.step(in);
    const bool hit = k >= 50 && k < 55;
    const double age = hit ? (k - 49) * h : 0.0;
    EXPECT_EQ(std::isnan(m.sensed.angle_deg), hit);
    EXPECT_EQ(std::isnan(n.sensed.volts[1]), hit);
    EXPECT_NEAR(m.age_s, age, 1e-12);
    EXPECT_EQ(n.age_s, 0.0);
    EXPECT_NEAR(s.age_s, age, 1e-12);
    if (!hit) last = a.sensed;
    EXPECT_EQ(s.sensed.volts, last.volts);
    EXPECT_EQ(m.angle_deg, a.angle_deg);  // the plate knows nothing of it
    if (!hit) {
      EXPECT_EQ(m.sensed.volts, a.sensed.volts);
    }
  }
}

TEST(ThrottleFaults, AStaleSampleBeforeAnyGoodOneIsAMissingOne) {
  VirtualThrottle bench(with({{Kind::stale_sample, 0.0, 0.0, 0.01}}));
  const auto first = bench.step({0.0, 12.0, 0.0});
  EXPECT_TRUE(std::isnan(first.sensed.angle_deg));
  EXPECT_NEAR(first.age_s, 1e-3, 1e-12);
}

TEST(ThrottleFaults, AStaleSampleRepeatsTheLastGoodOneNotAnInvalidOne) {
  VirtualThrottle bench(with({{Kind::nan_sample, 0.05, 0.0, 0.06}, {Kind::stale_sample, 0.06, 0.0, 0.07}}));
  throttle::SensorReading last;
  for (int k = 0; k < 70; ++k) {
    const auto now = bench.step({lively_duty(k), 12.0, 0.0});
    if (k < 50) last = now.sensed;
    if (k >= 60) {
      EXPECT_EQ(now.sensed.volts, last.volts);
      EXPECT_NEAR(now.age_s, (k - 49) * 1e-3, 1e-12);
    }
  }
}

TEST(ThrottleFaults, AnOpenBridgePassesNoCurrentWhateverTheDuty) {
  VirtualThrottle bench(with({}, 70.0));
  VirtualThrottleSample now;
  for (int k = 0; k < 400; ++k) {
    now = bench.step({1.0, 12.0, 0.0, true});
    EXPECT_EQ(now.current_a, 0.0);
  }
  EXPECT_NEAR(now.angle_deg, 8.0, 0.5);
  now = bench.step({1.0, 12.0, 0.0, false});
  EXPECT_GT(now.current_a, 0.1);
}

TEST(ThrottleFaults, NoAllocation) {
  VirtualThrottle bench(with(
      {{Kind::jammed_at, 0.02, 18.0, 0.12}, {Kind::spring_above, 0.03, 1.0}, {Kind::missing_sample, 0.05, 0.0, 0.06}}));
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 500; ++k)
    (void)bench.step({0.5, 12.0, 0.0});
  EXPECT_EQ(counter.count(), 0u);
}

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
