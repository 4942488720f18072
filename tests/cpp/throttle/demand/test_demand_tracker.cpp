// The reference of the plate sample by sample: rate and filter, repeated inputs, no allocation.
#include <cmath>
#include <limits>
#include <utility>

#include <gtest/gtest.h>

#include "mgdd/throttle/demand/demand_chain.hpp"
#include "support/demand_case.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::throttle {
namespace {

using test_support::odd_chain;

static_assert(noexcept(std::declval<DemandTracker&>().step(0.0, 0.0, 0.0)));

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double sample = 1e-3;

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
