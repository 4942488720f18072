// A throttle with its sensors, sample by sample: the plant's own run, and no allocation.
#include "mgdd/loop/virtual_throttle.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::loop {
namespace {

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
