// The virtual throttle alone and side by side.
#include "mgdd/common/error.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/loop/throttle_controllers.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "mgdd/loop/virtual_throttle_lanes.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

/// Each differs in plant, sensors, seed and start from its neighbours.
VirtualThrottleSettings plant_of(std::size_t i) {
  const auto x = static_cast<double>(i);
  VirtualThrottleSettings s;
  s.throttle.coulomb_nm *= 0.7 + 0.08 * x;
  s.throttle.stiction_nm = s.throttle.coulomb_nm * 1.2;
  s.throttle.spring_below_nm_per_rad *= 1.0 + 0.05 * x;
  s.throttle.pressure_drop_kpa = i % 3 == 0 ? 0.0 : 4.0 + x;
  s.throttle.supply_v = 12.0 + 0.1 * x;
  s.sensors.noise_v = 0.001 * (1.0 + x);
  s.seed = 11 + i;
  s.start_deg = 3.0 + 7.0 * x;
  return s;
}

std::vector<VirtualThrottleSettings> plants(std::size_t n) {
  std::vector<VirtualThrottleSettings> out;
  for (std::size_t i = 0; i < n; ++i)
    out.push_back(plant_of(i));
  return out;
}

TEST(VirtualThrottleLanes, EachHasTheBitsThatItHasAlone) {
  for (const std::size_t n : {1u, 5u, 8u}) {
    const auto settings = plants(n);
    VirtualThrottleLanes lanes(settings);
    ASSERT_EQ(lanes.size(), n);
    std::vector<VirtualThrottle> alone(settings.begin(), settings.end());
    std::vector<VirtualThrottleInputs> inputs(n);
    std::vector<VirtualThrottleSample> out(n);
    for (int k = 0; k < 400; ++k) {
      for (std::size_t i = 0; i < n; ++i) {
        const double phase = 0.02 * k + 0.7 * static_cast<double>(i);
        inputs[i] = {0.15 + 0.4 * std::sin(phase), 11.0 + std::cos(phase), 0.02 * std::sin(3.0 * phase)};
      }
      if (k == 200) inputs[n / 2].duty = std::numeric_limits<double>::quiet_NaN();
      lanes.step(inputs, out);
      for (std::size_t i = 0; i < n; ++i) {
        const VirtualThrottleSample one = alone[i].step(inputs[i]);
        ASSERT_EQ(out[i].angle_deg, one.angle_deg) << i << ' ' << k;
        ASSERT_EQ(out[i].speed_deg_per_s, one.speed_deg_per_s);
        ASSERT_EQ(out[i].current_a, one.current_a);
        ASSERT_EQ(out[i].sensed.angle_deg, one.sensed.angle_deg);
        ASSERT_EQ(out[i].sensed.volts, one.sensed.volts);
        ASSERT_EQ(out[i].supply_v, one.supply_v);
        ASSERT_EQ(out[i].sample, one.sample);
        ASSERT_EQ(out[i].age_s, one.age_s);
      }
    }
    EXPECT_NE(out.front().angle_deg, settings.front().start_deg) << "they move";
  }
}

TEST(VirtualThrottleLanes, AStepAllocatesNothing) {
  VirtualThrottleLanes lanes(plants(6));
  const std::vector<VirtualThrottleInputs> inputs(6, {0.4, 12.0, 0.0});
  std::vector<VirtualThrottleSample> out(6);
  lanes.step(inputs, out);
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 50; ++k)
    lanes.step(inputs, out);
  EXPECT_EQ(counter.count(), 0u);
  static_assert(noexcept(lanes.step(inputs, out)));
}

TEST(VirtualThrottleLanes, RefusesWhatCannotRunSideBySide) {
  EXPECT_THROW(VirtualThrottleLanes(plants(0)), ParameterError);
  EXPECT_THROW(VirtualThrottleLanes(plants(9)), ParameterError);
  const auto refuses = [](const auto& change) {
    auto mixed = plants(4);
    change(mixed[2]);
    EXPECT_FALSE(side_by_side(mixed[0], mixed[2]));
    EXPECT_THROW(VirtualThrottleLanes{mixed}, ParameterError);
  };
  refuses([](VirtualThrottleSettings& s) { s.throttle.friction = throttle::Friction::tanh; });
  refuses([](VirtualThrottleSettings& s) { s.throttle.backlash = throttle::Backlash::compliance; });
  refuses([](VirtualThrottleSettings& s) { s.sample_s = 2e-3; });
  refuses([](VirtualThrottleSettings& s) { s.step_s = 5e-5; });
  refuses([](VirtualThrottleSettings& s) { s.bridge = throttle::Bridge::open; });
  refuses([](VirtualThrottleSettings& s) { s.plant_faults.push_back({}); });
  auto bad = plants(4);
  bad[3].throttle.inertia_kgm2 = -1.0;
  EXPECT_THROW(VirtualThrottleLanes{bad}, ParameterError);
}

// Two forms of friction and a plate with a fault stand between the others: groups of 4, 2, 1 and 6 plants.
TEST(VirtualThrottleLanes, ManyLoopsHaveTheBitsOfSingleOnesHoweverTheyAreGrouped) {
  ThrottleMonteCarlo plan;
  plan.plants = plants(8);
  for (std::size_t i = 0; i < 5; ++i)
    plan.plants.push_back(plant_of(i + 2));
  plan.plants[4].throttle.friction = plan.plants[5].throttle.friction = throttle::Friction::tanh;
  plan.plants[6].plant_faults.push_back({.kind = ThrottleFaultKind::supply_sag, .from_s = 0.05, .size = 8.0});
  control::PidSettings slow;
  slow.above.proportional_per_deg *= 0.5;
  plan.controllers = {control::Pid{control::PidSettings{}}, control::Pid{slow}};
  for (const double to : {25.0, 41.0}) {
    ThrottleScenario s;
    s.reference_deg.assign(60, 30.0);
    s.reference_deg.insert(s.reference_deg.end(), 200, to);
    s.from = 60;
    plan.scenarios.push_back(s);
    plan.band_deg.push_back(0.5);
  }
  for (const int threads : {1, 3}) {
    plan.threads = threads;
    const auto all = monte_carlo(plan, {});
    ASSERT_EQ(all.finished, std::vector<bool>(std::size_t{13} * 2 * 2, true));
    for (std::size_t p = 0; p < 13; ++p) {
      for (std::size_t c = 0; c < 2; ++c) {
        for (std::size_t s = 0; s < 2; ++s) {
          control::Pid pid = std::get<control::Pid>(plan.controllers[c]);
          VirtualThrottleSettings plant = plan.plants[p];
          plant.start_deg = 30.0;
          const auto track = run_throttle_loop(pid, plant, plan.delay_samples, plan.scenarios[s]);
          const auto one = tracking_figures(plan.scenarios[s], track, plant.sample_s, 0.5);
          const auto& got = all.figures[(p * 2 + c) * 2 + s];
          EXPECT_EQ(got.mse_deg2, one.mse_deg2) << p << c << s;
          EXPECT_EQ(got.total_variation, one.total_variation);
          EXPECT_EQ(got.largest_error_deg, one.largest_error_deg);
        }
      }
    }
  }
}

// What was stopped is not finished in any of its lanes.
TEST(VirtualThrottleLanes, WhatWasStoppedIsNotFinished) {
  ThrottleMonteCarlo plan;
  plan.plants = plants(8);
  plan.controllers = {control::Pid{control::PidSettings{}}};
  ThrottleScenario s;
  s.reference_deg.assign(400, 30.0);
  plan.scenarios.assign(400, s);
  plan.band_deg.assign(400, 0.5);
  const auto some = monte_carlo(plan, [] { return true; });
  ASSERT_EQ(some.finished.size(), 8u * 400u);
  for (std::size_t p = 1; p < 8; ++p) {
    for (std::size_t i = 0; i < 400; ++i)
      ASSERT_EQ(some.finished[i], some.finished[p * 400 + i]) << "lanes end together";
  }
  EXPECT_FALSE(some.finished.back());
}

static_assert(noexcept(std::declval<VirtualThrottle&>().step({})));

VirtualThrottleSettings lively() {
  VirtualThrottleSettings s;
  s.start_deg = 12.0;
  s.seed = 5;
  s.faults[1] = {throttle::SensorFaultKind::stuck, 0.05, 0.0};
  return s;
}

double duty_of(int k) {
  return 0.3 * std::sin(0.02 * k) + 0.1;
}

TEST(VirtualThrottle, IsThePlantOfARunWithOneDutyPerSample) {
  VirtualThrottle bench(lively());
  std::vector<double> duty;
  for (int k = 0; k < 200; ++k)
    duty.push_back(duty_of(k));
  std::vector<double> expected(duty.size());
  const throttle::ThrottlePlant plant(throttle::Throttle{});
  throttle::ThrottleState state = throttle::at_rest(12.0);
  simulate(plant, {.duty = duty}, 10, state, {.angle_deg = expected});
  for (std::size_t k = 0; k + 1 < duty.size(); ++k)
    EXPECT_EQ(bench.step({duty[k], 12.0, 0.0}).angle_deg, expected[k + 1]) << k;
}

TEST(VirtualThrottle, InputsThatAreNotFiniteRepeatTheLastOnes) {
  VirtualThrottle one(lively());
  VirtualThrottle other(lively());
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 40; ++k) {
    const double told = k % 3 == 2 ? nan : duty_of(k - k % 3);
    EXPECT_EQ(one.step({duty_of(k - k % 3), 11.0, -0.02}).angle_deg,
              other.step({told, k % 3 == 2 ? nan : 11.0, k % 3 == 2 ? nan : -0.02}).angle_deg);
  }
}

TEST(VirtualThrottle, NoAllocationAndARefusedSettingNamesItself) {
  VirtualThrottle bench(lively());
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 1000; ++k)
    (void)bench.step({duty_of(k), 12.0, 0.0});
  EXPECT_EQ(counter.count(), 0u);
  VirtualThrottleSettings bad = lively();
  bad.start_deg = 91.0;
  EXPECT_THROW(VirtualThrottle{bad}, ParameterError);
  bad = lively();
  bad.sample_s = 2.5e-4;
  EXPECT_THROW(VirtualThrottle{bad}, ParameterError);
}

}  // namespace
}  // namespace mgdd::loop
