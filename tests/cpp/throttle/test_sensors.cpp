// The two position sensors: slopes, resolution, noise, and which faults the check between them sees.
#include "mgdd/throttle/sensors.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace {

using namespace mgdd::throttle;

constexpr double sample_s = 1e-3;
constexpr std::array<SensorFault, 2> healthy{};

std::array<SensorFault, 2> first(SensorFaultKind kind, double size = 0.0, double from_s = 0.0) {
  return {SensorFault{kind, from_s, size}, SensorFault{}};
}

struct Share {
  double sum = 0.0, range = 0.0;  ///< of samples in which the check fails
  double latched_s = std::numeric_limits<double>::quiet_NaN();
};
Share share(const SensorPair& pair, const std::array<SensorFault, 2>& faults, double angle_deg, int samples = 20'000) {
  SensorSampler sampler(pair, sample_s, 7, faults);
  Share out;
  for (int k = 0; k < samples; ++k) {
    const SensorReading r = sampler.step(angle_deg);
    out.sum += r.sum_fault ? 1.0 / samples : 0.0;
    out.range += r.range_fault[0] || r.range_fault[1] ? 1.0 / samples : 0.0;
    if (r.fault && std::isnan(out.latched_s)) out.latched_s = k * sample_s;
  }
  return out;
}

TEST(Sensors, HaveOppositeSlopesThatAddUpToTheSupply) {
  SensorPair quiet;
  quiet.noise_v = 0.0;
  quiet.adc_bits = 24;
  SensorSampler sampler(quiet, sample_s, 0, healthy);
  for (int k = 0; k < 40; ++k)
    sampler.step(45.0);
  const SensorReading r = sampler.step(45.0);
  EXPECT_NEAR(r.volts[0], 2.5, 1e-6);
  EXPECT_NEAR(r.volts[1], 2.5, 1e-6);
  SensorPair ideal = quiet;
  ideal.closed_v = 0.0;
  ideal.span_v = 5.0;
  EXPECT_NEAR(SensorSampler(ideal, sample_s, 0, healthy).step(18.0).volts[0], 1.0, 1e-6);
  EXPECT_NEAR(SensorSampler(quiet, sample_s, 0, healthy).step(90.0).volts[0], 4.5, 1e-6);
  EXPECT_NEAR(SensorSampler(quiet, sample_s, 0, healthy).step(90.0).volts[1], 0.5, 1e-6);
}

TEST(Sensors, ResolveAFourThousandthOfFiveVolts) {
  SensorPair quiet;
  quiet.noise_v = 0.0;
  EXPECT_NEAR(quiet.lsb_v(), 1.2207e-3, 1e-7);
  EXPECT_NEAR(quiet.lsb_v() / quiet.span_v * quiet.travel_deg, 0.0275, 1e-4);  // deg
  for (double angle = 0.0; angle <= 90.0; angle += 0.37) {
    EXPECT_NEAR(SensorSampler(quiet, sample_s, 0, healthy).step(angle).angle_deg, angle, 0.01374);
  }
}

TEST(Sensors, SumStaysWithinItsTolerance) {
  SensorSampler sampler(SensorPair{}, sample_s, 3, healthy);
  double worst = 0.0, square = 0.0;
  constexpr int samples = 20'000;
  for (int k = 0; k < samples; ++k) {
    const SensorReading r = sampler.step(90.0 * k / samples);
    worst = std::max(worst, std::abs(r.sum_error_v));
    square += r.sum_error_v * r.sum_error_v / samples;
    EXPECT_FALSE(r.fault);
  }
  EXPECT_LE(worst, 13.8e-3);  // 2 LSB + 4 sqrt(2) sigma
  const double lsb = SensorPair{}.lsb_v();
  EXPECT_NEAR(std::sqrt(square), std::sqrt(2.0 * 0.002 * 0.002 + lsb * lsb / 6.0), 5e-5);
}

TEST(Sensors, FilterHasItsTimeConstant) {
  SensorPair slow;
  slow.noise_v = 0.0;
  slow.adc_bits = 24;
  slow.lag_s = 0.01;
  SensorSampler sampler(slow, sample_s, 0, healthy);
  sampler.step(0.0);
  SensorReading r;
  for (int k = 0; k < 10; ++k)
    r = sampler.step(90.0);
  EXPECT_NEAR(r.angle_deg, 90.0 * (1.0 - std::exp(-1.0)), 1e-3);
}

TEST(Sensors, CheckSeesWiresShortsAndLargeOffsets) {
  for (const SensorFaultKind kind :
       {SensorFaultKind::open_wire, SensorFaultKind::short_to_ground, SensorFaultKind::short_to_supply}) {
    for (const double angle : {1.0, 30.0, 60.0, 89.0}) {
      const Share s = share(SensorPair{}, first(kind, 0.0, 0.5), angle, 1000);
      EXPECT_NEAR(s.latched_s - 0.5, 0.2, 1.1e-3) << "kind " << static_cast<int>(kind) << ", " << angle << " deg";
    }
  }
  for (const double size : {0.25, -0.25}) {
    const Share s = share(SensorPair{}, first(SensorFaultKind::offset, size), 45.0);
    EXPECT_NEAR(s.sum, 1.0, 1e-9);
    EXPECT_LE(s.latched_s, 0.2);
    const std::array<SensorFault, 2> second{SensorFault{}, SensorFault{SensorFaultKind::offset, 0.0, size}};
    EXPECT_LE(share(SensorPair{}, second, 45.0).latched_s, 0.2);
  }
}

// The threshold lies 163.84 LSB off: a sum of 163 codes or less passes. The noise of the sum decides the share.
TEST(Sensors, OffsetOfExactlyTheToleranceIsOftenMissed) {
  const auto normal = [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); };
  const double lsb = SensorPair{}.lsb_v();
  const auto missed = [&](double sigma_of_sum_v) {
    return normal((163.5 - 0.2 / lsb) / std::hypot(sigma_of_sum_v / lsb, std::sqrt(1.0 / 6.0)));
  };
  const SensorFault offset{SensorFaultKind::offset, 0.0, 0.2};
  const Share both = share(SensorPair{}, {offset, SensorFault{}}, 45.0, 60'000);
  EXPECT_NEAR(1.0 - both.sum, missed(0.002 * std::sqrt(2.0)), 0.008);
  EXPECT_NEAR(1.0 - both.sum, 0.442, 0.01);
  EXPECT_LT(both.latched_s, 2.0);  // never for 200 ms in a row, and told all the same
  SensorPair calmer;
  calmer.noise_v = 0.002 / std::sqrt(2.0);  // 2 mV in the sum
  const Share one = share(calmer, {offset, SensorFault{}}, 45.0, 60'000);
  EXPECT_NEAR(1.0 - one.sum, 0.42, 0.01);
}

TEST(Sensors, GainDriftShowsNearFullOpeningOnly) {
  // 5 % of V1 reaches 0.2 V at 4 V, which is 78.75 deg.
  SensorPair quiet;
  quiet.noise_v = 0.0;
  EXPECT_EQ(share(quiet, first(SensorFaultKind::gain, 0.05), 78.5, 100).sum, 0.0);
  EXPECT_NEAR(share(quiet, first(SensorFaultKind::gain, 0.05), 79.2, 100).sum, 1.0, 1e-9);
  // Noise blurs the edge by a few degrees: 2.2 mV per degree against 2.9 mV rms.
  EXPECT_LT(share(SensorPair{}, first(SensorFaultKind::gain, 0.05), 74.0).sum, 1e-3);
  EXPECT_GT(share(SensorPair{}, first(SensorFaultKind::gain, 0.05), 84.0).sum, 0.999);
}

TEST(Sensors, StuckSensorShowsOnceThePlateMoves) {
  SensorSampler sampler(SensorPair{}, sample_s, 1, first(SensorFaultKind::stuck, 0.0, 0.1));
  for (int k = 0; k < 1000; ++k)
    EXPECT_FALSE(sampler.step(30.0).fault);
  SensorReading r;
  for (int k = 0; k < 250; ++k)
    r = sampler.step(40.0);
  EXPECT_TRUE(r.fault);
  EXPECT_NEAR(r.volts[0], 0.5 + 30.0 * 4.0 / 90.0, 0.01);
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

TEST(Sensors, SecondSensorServesWhereTheFirstIsOutOfRange) {
  SensorSampler sampler(SensorPair{}, sample_s, 1, first(SensorFaultKind::short_to_supply));
  EXPECT_NEAR(sampler.step(30.0).angle_deg, 30.0, 0.3);
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

TEST(Sensors, EqualSeedsGiveEqualNoise) {
  SensorSampler one(SensorPair{}, sample_s, 5, healthy), same(SensorPair{}, sample_s, 5, healthy);
  SensorSampler other(SensorPair{}, sample_s, 6, healthy);
  int differ = 0;
  for (int k = 0; k < 100; ++k) {
    const SensorReading r = one.step(40.0);
    EXPECT_EQ(r.volts, same.step(40.0).volts);
    differ += r.volts != other.step(40.0).volts ? 1 : 0;
  }
  EXPECT_GT(differ, 50);
}

TEST(Sensors, StepAllocatesNothing) {
  SensorSampler sampler(SensorPair{}, sample_s, 5, first(SensorFaultKind::stuck));
  static_assert(noexcept(sampler.step(0.0)));
  const mgdd::test_support::AllocationCounter allocations;
  for (int k = 0; k < 100; ++k)
    sampler.step(0.9 * k);
  EXPECT_EQ(allocations.count(), 0U);
}

TEST(Sensors, BadSettingsAreNamed) {
  const auto refused = [](auto&& change, const std::string& part) {
    SensorPair pair;
    change(pair);
    try {
      validate(pair);
      ADD_FAILURE() << part;
    } catch (const mgdd::ParameterError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  refused([](SensorPair& p) { p.span_v = 4.6; }, "closed_v + span_v must be <= supply_v");
  refused([](SensorPair& p) { p.noise_v = -1.0; }, "noise_v = -1 V");
  refused([](SensorPair& p) { p.adc_bits = 30; }, "adc_bits = 30");
  refused([](SensorPair& p) { p.high_v = 0.1; }, "high_v = 0.1 V: must be in [0.2, 5]");
  refused([](SensorPair& p) { p.debounce_s = std::nan(""); }, "debounce_s = nan");
  EXPECT_THROW(SensorSampler(SensorPair{}, 0.0, 0, healthy), mgdd::ParameterError);
  EXPECT_THROW(SensorSampler(SensorPair{}, sample_s, 0, first(SensorFaultKind::gain, std::nan(""))),
               mgdd::ParameterError);
  EXPECT_NO_THROW(SensorSampler(SensorPair{}, sample_s, 0, healthy));
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
