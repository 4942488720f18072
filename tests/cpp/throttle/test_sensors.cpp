// The two position sensors: faults that are short or lie at the tolerance; test_sensor_equations.cpp has the rest.
#include "mgdd/throttle/sensors.hpp"

#include <gtest/gtest.h>

#include <array>

namespace {

using namespace mgdd::throttle;

constexpr double sample_s = 1e-3;
constexpr std::array<SensorFault, 2> healthy{};

std::array<SensorFault, 2> first(SensorFaultKind kind, double size = 0.0, double from_s = 0.0) {
  return {SensorFault{kind, from_s, size}, SensorFault{}};
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
