// From a pedal to the angle of the plate: the chain, and its tracker sample by sample.
#include "mgdd/throttle/demand/demand_chain.hpp"
#include "support/demand_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::throttle {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double sample = 1e-3;

using test_support::odd_chain;

TEST(PedalMap, TheDefaultIsTheProgressiveFormula) {
  const PedalMap map;
  EXPECT_EQ(map.wanted_nm.size(), 64u);
  // 45 % at 3500 rpm of 113 N m full load, last speed 6000 rpm.
  const double share = 0.6 * 0.45 + 0.4 * 0.45 * 0.45 - 0.1 * 0.55 * 3500.0 / 6000.0;
  EXPECT_NEAR(map.torque_nm(45.0, 3500.0), 113.0 * share, 1e-12);
  EXPECT_NEAR(map.torque_nm(100.0, 2000.0), 117.0, 1e-12);
  EXPECT_NEAR(map.torque_nm(0.0, 6000.0), -10.4, 1e-12);
  EXPECT_EQ(map.torque_nm(130.0, 9000.0), map.torque_nm(100.0, 6000.0));
  EXPECT_TRUE(std::isnan(map.torque_nm(nan, 2000.0)));
  EXPECT_TRUE(std::isnan(map.torque_nm(20.0, nan)));
}

TEST(Demand, TorqueComesBackThroughOpeningAndAir) {
  for (const DemandChain& chain : {DemandChain{}, odd_chain()}) {
    const DemandModel model(chain);
    const Manifold manifold(chain.air, chain.bore, sample);
    int seen = 0;
    for (double speed = 800.0; speed <= 6000.0; speed += 400.0) {
      for (double pedal = 0.0; pedal <= 100.0; pedal += 2.5) {
        const Demand demand = model.steady(pedal, speed);
        if (demand.pressure_pa > 0.95e3 * chain.air.ambient_kpa || demand.opening_deg <= 0.0) continue;
        const double pressure = manifold.steady_pa({demand.opening_deg, speed});
        const double air = chain.air.pumping_kg_per_s_pa(speed) * pressure;
        EXPECT_NEAR(air / demand.air_kg_per_s, 1.0, 1e-9);
        EXPECT_NEAR(chain.torque.torque_nm(air, speed), demand.torque_nm, 1e-4 * std::fabs(demand.torque_nm) + 1e-7);
        ++seen;
      }
    }
    EXPECT_GT(seen, 400);
  }
}

TEST(Demand, WhatTheEngineCannotMakeOpensMonotonouslyAndGetsTheAirThereIs) {
  DemandChain strong;
  for (double& torque : strong.pedal_map.wanted_nm)
    torque *= 1.7;
  const DemandModel model(strong);
  const Manifold manifold(strong.air, strong.bore, sample);
  for (const double speed : {800.0, 2500.0, 6500.0}) {
    double last = -1.0;
    for (double pedal = 0.0; pedal <= 100.0; pedal += 1.0) {
      const Demand demand = model.steady(pedal, speed);
      EXPECT_GE(demand.opening_deg, last);
      EXPECT_LE(demand.opening_deg, 90.0);
      last = demand.opening_deg;
    }
    EXPECT_GT(model.steady(100.0, speed).pressure_pa, 101325.0);
    EXPECT_GT(manifold.steady_pa({last, speed}), 0.985 * manifold.steady_pa({90.0, speed}));
  }
}

TEST(Demand, AMeasuredPressureCountsUpToTheHighestRatioAndTheWantedOneBeyond) {
  const DemandModel model(odd_chain());
  const Manifold manifold(odd_chain().air, odd_chain().bore, sample);
  const double ambient = 96.4e3, air = 0.02, wanted = 0.7 * ambient;
  for (const double ratio : {0.3, 0.6, 0.85, 0.899}) {
    const double angle = model.opening_deg(air, ratio * ambient, wanted);
    EXPECT_NEAR(manifold.throttle_kg_per_s(angle, ratio * ambient) / air, 1.0, 1e-9) << ratio;
  }
  for (const double ratio : {0.951, 1.0, 1.3}) {
    const double angle = model.opening_deg(air, ratio * ambient, wanted);
    EXPECT_NEAR(manifold.throttle_kg_per_s(angle, wanted) / air, 1.0, 1e-9) << ratio;
  }
}

TEST(Demand, BelowTheMapTheTorqueOfItsFirstSpeedIsMadeAtTheTrueOne) {
  const DemandModel model(odd_chain());
  const double asked = model.steady(30.0, odd_chain().pedal_map.speed_rpm.front()).torque_nm;
  for (const double speed : {300.0, 450.0, 640.0}) {
    const Demand wanted = model.steady(30.0, speed);
    EXPECT_EQ(wanted.torque_nm, asked);
    EXPECT_NEAR(odd_chain().torque.torque_nm(wanted.air_kg_per_s, speed), asked, 1e-9) << speed;
  }
}

TEST(Demand, AStandingEngineWantsWhatOneWouldThatIsStarted) {
  const DemandModel model(odd_chain());
  const Demand still = model.steady(30.0, 0.0), started = model.steady(30.0, 300.0);
  EXPECT_EQ(still.opening_deg, started.opening_deg);
  EXPECT_EQ(still.air_kg_per_s, started.air_kg_per_s);
  EXPECT_GT(started.opening_deg, 0.5);
}

TEST(Demand, TheWidestReferenceIsNeverPassed) {
  DemandChain chain = odd_chain();
  chain.reference.widest_deg = 22.0;
  EXPECT_EQ(DemandModel(chain).steady(100.0, 6000.0).opening_deg, 22.0);
  DemandTracker tracker(chain, sample);
  tracker.take_over(60.0);
  EXPECT_EQ(tracker.step(nan, nan, nan).reference_deg, 22.0);
  for (int k = 0; k < 300; ++k)
    EXPECT_LE(tracker.step(100.0, 6000.0, nan).reference_deg, 22.0);
}

TEST(Demand, NothingThatAMeasuredPressureCanBeGivesAJump) {
  const DemandModel model{DemandChain{}};
  const double air = 0.03, wanted = 0.93 * 101325.0;
  double last = model.opening_deg(air, 80e3, wanted);
  for (double pressure = 80e3; pressure < 130e3; pressure += 5.0) {
    const double opening = model.opening_deg(air, pressure, wanted);
    EXPECT_LT(std::fabs(opening - last), 0.05) << pressure;
    last = opening;
  }
}

TEST(DemandChain, EveryNumberHasOneField) {
  DemandChain chain;
  double at = 0.5;
  for (const auto& field : demand_fields())
    field.in(chain) = at += 1.0;
  EXPECT_EQ(sizeof(EngineTorque) + sizeof(IntakeAir) + sizeof(ThrottleBore) + sizeof(ReferenceShape),
            demand_fields().size() * sizeof(double));
  at = 0.5;
  for (const auto& field : demand_fields())
    EXPECT_EQ(field.in(chain), at += 1.0);
}

static_assert(noexcept(std::declval<DemandTracker&>().step(0.0, 0.0, 0.0)));

TEST(Tracker, WithoutAMeasuredPressureItTakesTheWantedOne) {
  DemandTracker with(odd_chain(), sample), without(odd_chain(), sample);
  for (int k = 0; k < 400; ++k) {
    const double pedal = k < 50 ? 12.0 : 70.0;
    const TrackedDemand blind = without.step(pedal, 2600.0, nan);
    const TrackedDemand told = with.step(pedal, 2600.0, blind.pressure_pa);
    EXPECT_EQ(told.reference_deg, blind.reference_deg) << k;
  }
}

TEST(Tracker, TheReferenceKeepsItsRateAndSettlesWithItsFilter) {
  DemandChain chain = odd_chain();
  chain.reference.pressure_lag_s = 0.0;
  chain.reference.filling_share = 0.0;
  chain.reference.reference_rate_deg_per_s = 300.0;
  DemandTracker tracker(chain, sample);
  const DemandModel model(chain);
  double last = tracker.step(5.0, 1500.0, nan).reference_deg;
  const double target = model.steady(90.0, 1500.0).opening_deg;
  ASSERT_GT(target - last, 15.0);
  const double way = target - last;
  double limited = last;
  for (int k = 0; k < 600; ++k) {
    const TrackedDemand out = tracker.step(90.0, 1500.0, nan);
    EXPECT_LE(std::fabs(out.reference_deg - last), 0.3 + 1e-12);
    limited += std::fmin(0.3, target - limited);
    const double wanted = last + (1.0 - std::exp(-0.08)) * (limited - last);
    EXPECT_NEAR(out.reference_deg, wanted, 1e-9);
    last = out.reference_deg;
  }
  EXPECT_NEAR(last, target, 1e-6 * way);
}

TEST(Tracker, InputsThatAreNotFiniteRepeatTheLastOnes) {
  DemandTracker tracker(odd_chain(), sample), other(odd_chain(), sample);
  EXPECT_EQ(tracker.step(nan, 1500.0, 40e3).reference_deg, 0.0);
  EXPECT_EQ(tracker.step(20.0, nan, nan).reference_deg, other.step(20.0, 1500.0, 40e3).reference_deg);
  for (int k = 0; k < 100; ++k) {
    const double infinity = std::numeric_limits<double>::infinity();
    const TrackedDemand gap = tracker.step(k % 3 == 0 ? nan : 60.0, k % 5 == 0 ? infinity : 2500.0, nan);
    const TrackedDemand held = other.step(k == 0 ? 20.0 : 60.0, k == 0 ? 1500.0 : 2500.0, 40e3);
    EXPECT_EQ(gap.reference_deg, held.reference_deg) << k;
  }
}

TEST(Tracker, HoldsAtStandstillAndBeyondTheTable) {
  DemandTracker tracker(odd_chain(), sample);
  for (const double speed : {0.0, -100.0, 1e9}) {
    for (const double pedal : {-20.0, 0.0, 300.0}) {
      for (int k = 0; k < 50; ++k) {
        const TrackedDemand out = tracker.step(pedal, speed, k % 2 == 0 ? 0.0 : 500e3);
        EXPECT_TRUE(std::isfinite(out.reference_deg) && std::isfinite(out.air_kg_per_s));
        EXPECT_GE(out.reference_deg, 0.0);
        EXPECT_LE(out.reference_deg, 90.0);
      }
    }
  }
}

TEST(Tracker, ResetForgetsEverything) {
  DemandTracker tracker(odd_chain(), sample);
  const StateColumns fresh = save_state(tracker);
  (void)tracker.step(40.0, 1800.0, 50e3);
  tracker.reset();
  EXPECT_EQ(save_state(tracker), fresh);
}

TEST(Tracker, NoAllocation) {
  DemandTracker tracker(odd_chain(), sample);
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 1000; ++k)
    (void)tracker.step(k % 101, 800.0 + k, 30e3 + 70.0 * k);
  tracker.take_over(3.0);
  tracker.reset();
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::throttle
