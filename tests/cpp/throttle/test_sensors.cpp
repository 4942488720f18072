// The two position sensors: faults that end or lie at the tolerance; test_sensor_equations.cpp has the rest.
#include "mgdd/throttle/sensors.hpp"

#include <gtest/gtest.h>

#include <array>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace {

using namespace mgdd::throttle;

constexpr double sample_s = 1e-3;
constexpr std::array<SensorFault, 2> healthy{};

std::array<SensorFault, 2> first(SensorFaultKind kind, double size = 0.0, double from_s = 0.0) {
  return {SensorFault{kind, from_s, size}, SensorFault{}};
}

TEST(Sensors, AFaultThatEndsLeavesAWholeSensor) {
  for (const SensorFaultKind kind : {SensorFaultKind::stuck, SensorFaultKind::short_to_supply}) {
    std::array<SensorFault, 2> faults = first(kind, 0.0, 0.1);
    faults[0].until_s = 0.25;
    SensorSampler faulty(SensorPair{}, sample_s, 1, faults), whole(SensorPair{}, sample_s, 1, healthy);
    for (int k = 0; k < 400; ++k) {
      const double angle = 30.0 + 0.05 * k;
      const SensorReading a = faulty.step(angle), b = whole.step(angle);
      if (k < 100 || k >= 270) {
        EXPECT_EQ(a.volts, b.volts) << k;
      } else if (k > 110 && k < 250) {
        EXPECT_NE(a.volts, b.volts) << k;
      }
      EXPECT_FALSE(a.fault);  // shorter than the debounce time
    }
  }
  const SensorFault backwards{SensorFaultKind::stuck, 0.1, 0.0, 0.1};
  EXPECT_THROW(validate(backwards), mgdd::ParameterError);
}

TEST(Sensors, ShortFailureIsForgotten) {
  SensorSampler sampler(SensorPair{}, sample_s, 1, healthy);
  for (int k = 0; k < 1800; ++k) {  // 199 samples out of range, then twice as many within
    EXPECT_FALSE(sampler.step(k % 600 < 199 ? -20.0 : 30.0).fault) << k;
  }
  SensorReading r;
  for (int k = 0; k < 200; ++k)
    r = sampler.step(-20.0);
  EXPECT_TRUE(r.fault);
  EXPECT_TRUE(sampler.step(30.0).fault);  // latched
}

TEST(Sensors, StepAllocatesNothing) {
  SensorSampler sampler(SensorPair{}, sample_s, 5, first(SensorFaultKind::stuck));
  static_assert(noexcept(sampler.step(0.0)));
  const mgdd::test_support::AllocationCounter allocations;
  for (int k = 0; k < 100; ++k)
    sampler.step(0.9 * k);
  EXPECT_EQ(allocations.count(), 0U);
}

// Within 2 mV of the tolerance about half of the samples pass: the fault stands all the same.
TEST(Sensors, AnOffsetAtTheToleranceIsToldThoughHalfOfTheSamplesPass) {
  SensorSampler faulty(SensorPair{}, sample_s, 1, first(SensorFaultKind::offset, 0.2, 0.0));
  SensorSampler smaller(SensorPair{}, sample_s, 1, first(SensorFaultKind::offset, 0.19, 0.0));
  int k = 0;
  for (; k < 5000 && !faulty.step(30.0).fault; ++k)
    ASSERT_FALSE(smaller.step(30.0).fault);
  EXPECT_LT(k, 2000);
}

}  // namespace
