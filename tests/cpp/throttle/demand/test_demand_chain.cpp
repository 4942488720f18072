// From the pedal to the reference of the plate: the table of the pedal, round trips, laws of the reference (rate,
// filter, bumpless start, takeover, repeated inputs, restart), refusals, no allocation.
#include "mgdd/throttle/demand/demand_chain.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::throttle {
namespace {

static_assert(noexcept(std::declval<DemandTracker&>().step(0.0, 0.0, 0.0)));

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double sample = 1e-3;

DemandChain odd_chain() {
  DemandChain chain;
  chain.torque = {.indicated_efficiency = 0.36,
                  .heating_value_mj_per_kg = 43.1,
                  .stoichiometric_air_fuel = 14.3,
                  .air_fuel_ratio = 1.04,
                  .friction_nm = 11.0,
                  .friction_nm_per_rpm = 0.0041};
  chain.air = {.displacement_l = 1.62,
               .volumetric_efficiency = 0.91,
               .manifold_l = 2.3,
               .manifold_temperature_k = 323.0,
               .ambient_kpa = 96.4,
               .ambient_temperature_k = 287.0};
  chain.bore.bore_mm = 52.0;
  chain.bore.leak_mm2 = 1.5;
  return chain;
}

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

TEST(PedalMap, MoreTorqueWithMorePedal) {
  const PedalMap map;
  for (double speed = 500.0; speed < 7000.0; speed += 211.0) {
    double last = -1e9;
    for (double pedal = 0.0; pedal <= 100.0; pedal += 0.5) {
      EXPECT_GT(map.torque_nm(pedal, speed), last);
      last = map.torque_nm(pedal, speed);
    }
  }
}

TEST(Demand, FullPedalOfTheDefaultIsWhatTheEngineCanBreathe) {
  const DemandModel model{DemandChain{}};
  for (double speed = 800.0; speed <= 6000.0; speed += 100.0) {
    const Demand demand = model.steady(100.0, speed);
    EXPECT_LT(demand.pressure_pa / 101325.0, 0.95) << speed;
    EXPECT_LT(demand.opening_deg, 90.0) << speed;
  }
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

TEST(Demand, OpeningComesBackFromItsAir) {
  for (const DemandChain& chain : {DemandChain{}, odd_chain()}) {
    const DemandModel model(chain);
    const Manifold manifold(chain.air, chain.bore, sample);
    for (const double ratio : {0.1, 0.4, 0.53, 0.7, 0.9}) {
      const double pressure = ratio * chain.air.ambient_kpa * 1e3;
      for (double angle = 0.5; angle <= 89.5; angle += 0.5) {
        const double air = manifold.throttle_kg_per_s(angle, pressure);
        EXPECT_NEAR(model.opening_deg(air, pressure, pressure), angle, 1e-6) << ratio;
      }
    }
    // Up to the last ratio, where a share comes from the wanted pressure.
    const double last = 0.95e3 * chain.air.ambient_kpa;
    EXPECT_NEAR(model.opening_deg(manifold.throttle_kg_per_s(37.0, last), last, last), 37.0, 1e-6);
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

TEST(Demand, AStandingEngineWantsWhatItWouldAtTheFirstSpeed) {
  const DemandModel model(odd_chain());
  const Demand still = model.steady(30.0, 0.0), first = model.steady(30.0, 800.0);
  EXPECT_EQ(still.opening_deg, first.opening_deg);
  EXPECT_EQ(still.air_kg_per_s, first.air_kg_per_s);
  EXPECT_GT(first.opening_deg, 1.0);
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

TEST(Tracker, StartsAtItsSteadyDemandAndStaysThere) {
  const DemandModel model(odd_chain());
  DemandTracker tracker(odd_chain(), sample);
  const Demand steady = model.steady(33.0, 2100.0);
  for (int k = 0; k < 500; ++k) {
    const TrackedDemand out = tracker.step(33.0, 2100.0, steady.pressure_pa);
    EXPECT_NEAR(out.reference_deg, steady.opening_deg, 1e-9);
    EXPECT_NEAR(out.torque_nm, steady.torque_nm, 1e-12);
    EXPECT_NEAR(out.air_kg_per_s, steady.air_kg_per_s, 1e-15);
  }
}

TEST(Tracker, WithoutAMeasuredPressureItTakesTheWantedOne) {
  DemandTracker with(odd_chain(), sample), without(odd_chain(), sample);
  for (int k = 0; k < 400; ++k) {
    const double pedal = k < 50 ? 12.0 : 70.0;
    const TrackedDemand blind = without.step(pedal, 2600.0, nan);
    const TrackedDemand told = with.step(pedal, 2600.0, blind.pressure_pa);
    EXPECT_EQ(told.reference_deg, blind.reference_deg) << k;
  }
}

TEST(Tracker, OpensForTheMeasuredPressure) {
  DemandTracker tracker(odd_chain(), sample);
  const Manifold manifold(odd_chain().air, odd_chain().bore, sample);
  for (const double pressure : {30e3, 62e3, 75e3}) {
    const TrackedDemand out = tracker.step(40.0, 2500.0, pressure);
    EXPECT_NEAR(manifold.throttle_kg_per_s(out.opening_deg, pressure) / out.air_kg_per_s, 1.0, 1e-9) << pressure;
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

TEST(Tracker, FillingIsFedForwardSoThatThePressureFollowsItsLag) {
  // Without rate limit and filter, on the same manifold, the pressure is the wanted one.
  DemandChain chain = odd_chain();
  chain.reference.reference_rate_deg_per_s = 1e6;
  chain.reference.reference_bandwidth_per_s = 1e5;
  const Manifold manifold(chain.air, chain.bore, sample);
  const auto worst_of = [&](double share) {
    chain.reference.filling_share = share;
    DemandTracker own(chain, sample);
    Manifold::State state{DemandModel(chain).steady(15.0, 2000.0).pressure_pa};
    double worst = 0.0;
    for (int k = 0; k < 1500; ++k) {
      const TrackedDemand out = own.step(k < 100 ? 15.0 : k < 800 ? 55.0 : 25.0, 2000.0, state.pressure_pa);
      manifold.step(state, {out.reference_deg, 2000.0});
      worst = std::fmax(worst, std::fabs(state.pressure_pa - out.pressure_pa));
    }
    return worst;
  };
  EXPECT_LT(worst_of(1.0), 1000.0);
  EXPECT_GT(worst_of(0.0), 5000.0);
}

TEST(Tracker, TakesOverFromAnAngleWithoutABump) {
  DemandTracker tracker(odd_chain(), sample);
  tracker.take_over(41.0);
  EXPECT_EQ(tracker.step(nan, nan, nan).reference_deg, 41.0);
  double last = 41.0;
  for (int k = 0; k < 1000; ++k) {
    const double now = tracker.step(10.0, 1500.0, nan).reference_deg;
    EXPECT_LE(std::fabs(now - last), 0.8 + 1e-12);
    last = now;
  }
  EXPECT_NEAR(last, DemandModel(odd_chain()).steady(10.0, 1500.0).opening_deg, 1e-6);
  tracker.take_over(nan);
  EXPECT_NEAR(tracker.step(10.0, 1500.0, nan).reference_deg, last, 1e-9);
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

TEST(Tracker, GoesOnBitForBitAfterARestore) {
  DemandTracker first(odd_chain(), sample), second(odd_chain(), sample);
  const auto step = [](DemandTracker& tracker, int k) {
    return tracker.step(50.0 + 50.0 * std::sin(0.01 * k), 1500.0 + k, 50e3 + 20e3 * std::cos(0.02 * k)).reference_deg;
  };
  for (int k = 0; k < 333; ++k)
    (void)step(first, k);
  restore_state(second, save_state(first));
  for (int k = 333; k < 900; ++k)
    EXPECT_EQ(step(first, k), step(second, k));
  restore_state(second, save_state(DemandTracker(odd_chain(), sample)));  // one that has seen nothing
  EXPECT_EQ(second.step(nan, nan, nan).reference_deg, 0.0);
}

TEST(Tracker, AStateThatCannotBeIsRefusedAndChangesNothing) {
  DemandTracker tracker(odd_chain(), sample);
  (void)tracker.step(40.0, 1800.0, 50e3);
  const StateColumns before = save_state(tracker);
  StateColumns bad = before;
  bad["reference_deg"] = {90.5};
  EXPECT_THROW(restore_state(tracker, bad), ParameterError);
  bad = before;
  bad["limited_deg"] = {};
  EXPECT_THROW(restore_state(tracker, bad), ParameterError);
  bad = before;
  bad["wanted_pa"] = {-1.0};
  EXPECT_THROW(restore_state(tracker, bad), ParameterError);
  EXPECT_EQ(save_state(tracker), before);
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

TEST(DemandChain, ARefusedParameterNamesItself) {
  const auto refused = [](const std::string& field, const std::function<void(DemandChain&)>& change) {
    DemandChain chain = odd_chain();
    change(chain);
    try {
      (void)DemandTracker(chain, sample);
      ADD_FAILURE() << field << " was taken";
    } catch (const Error& error) {
      EXPECT_EQ(error.field, field);
    }
  };
  refused("displacement_l", [](DemandChain& c) { c.air.displacement_l = 0.0; });
  refused("manifold_temperature_k", [](DemandChain& c) { c.air.manifold_temperature_k = 20.0; });
  refused("indicated_efficiency", [](DemandChain& c) { c.torque.indicated_efficiency = nan; });
  refused("shaft_mm", [](DemandChain& c) { c.bore.shaft_mm = 52.0; });
  refused("plate_closed_deg", [](DemandChain& c) { c.bore.plate_closed_deg = 80.0; });
  refused("discharge_45", [](DemandChain& c) { c.bore.discharge_45 = 0.7; });
  refused("filling_share", [](DemandChain& c) { c.reference.filling_share = -0.1; });
  refused("reference_rate_deg_per_s", [](DemandChain& c) { c.reference.reference_rate_deg_per_s = 0.0; });
  refused("pedal_percent", [](DemandChain& c) { c.pedal_map.pedal_percent = {0.0}; });
  refused("pedal_percent[7]", [](DemandChain& c) { c.pedal_map.pedal_percent[7] = 101.0; });
  refused("speed_rpm[0]", [](DemandChain& c) { c.pedal_map.speed_rpm[0] = 0.0; });
  refused("wanted_nm", [](DemandChain& c) { c.pedal_map.wanted_nm.pop_back(); });
  refused("wanted_nm[3][2]", [](DemandChain& c) { c.pedal_map.wanted_nm[3 * 8 + 2] = nan; });
  refused("wanted_nm[3][2]", [](DemandChain& c) { c.pedal_map.wanted_nm[3 * 8 + 2] = -20.0; });
  for (const double bad : {0.0, 1.5, nan}) {
    try {
      (void)DemandTracker(odd_chain(), bad);
      ADD_FAILURE();
    } catch (const ParameterError& error) {
      EXPECT_EQ(error.field, "sample_s");
    }
  }
}

TEST(DemandChain, EveryNumberHasOneField) {
  DemandChain chain;
  double at = 0.5;
  for (const auto& field : demand_fields())
    field.in(chain) = at += 1.0;
  EXPECT_EQ(sizeof(EngineTorque) + sizeof(IntakeAir) + sizeof(ThrottleBore) + sizeof(ReferenceShape),
            n_demand_fields * sizeof(double));
  at = 0.5;
  for (const auto& field : demand_fields())
    EXPECT_EQ(field.in(chain), at += 1.0);
}

}  // namespace
}  // namespace mgdd::throttle
