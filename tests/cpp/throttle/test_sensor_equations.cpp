// The pair of sensors sample by sample against its equations, with settings that differ from their defaults; faults
// that are short or lie at the tolerance.
#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/throttle/sensors.hpp"
#include "support/test.hpp"

namespace mgdd::throttle {
namespace {

constexpr double sample_s = 2e-3;

SensorPair other_pair() {
  return {.closed_v = 0.7,
          .span_v = 3.4,
          .travel_deg = 84.0,
          .supply_v = 5.2,
          .noise_v = 0.011,
          .lag_s = 3e-3,
          .adc_bits = 11,
          .sum_tolerance_v = 0.31,
          .low_v = 0.35,
          .high_v = 4.6,
          .debounce_s = 0.01};
}

/// Exact volts: no noise, no filter, a converter without steps.
SensorPair exact_pair() {
  SensorPair p = other_pair();
  p.noise_v = p.lag_s = 0.0;
  p.adc_bits = 24;
  return p;
}

std::array<double, 2> volts_of(const SensorPair& p, const std::array<SensorFault, 2>& faults, double angle_deg) {
  return SensorSampler(p, sample_s, 3, faults).step(angle_deg).volts;
}

double clean(const SensorPair& p, std::size_t which, double angle_deg) {
  const double first = p.closed_v + p.span_v * angle_deg / p.travel_deg;
  return which == 0 ? first : p.supply_v - first;
}

TEST(SensorEquations, EveryFaultHasItsVoltageOnItsSensorAlone) {
  const SensorPair p = exact_pair();
  for (const double angle : {5.0, 30.0, 70.0}) {
    for (const std::size_t which : {0U, 1U}) {
      const double v = clean(p, which, angle);
      const std::pair<SensorFault, double> faulty[] = {
          {{SensorFaultKind::none}, v},
          {{SensorFaultKind::open_wire}, 0.0},
          {{SensorFaultKind::short_to_ground}, 0.0},
          {{SensorFaultKind::short_to_supply}, 5.2 - p.lsb_v()},
          {{SensorFaultKind::offset, 0.0, 0.13}, v + 0.13},
          {{SensorFaultKind::offset, 0.0, -0.21}, v - 0.21},
          {{SensorFaultKind::gain, 0.0, 0.06}, v * 1.06},
          {{SensorFaultKind::gain, 0.0, -0.3}, v * 0.7},
          {{SensorFaultKind::stuck}, v},
          {{SensorFaultKind::offset, 0.0, 90.0}, 5.2 - p.lsb_v()},  // inside the converter's range
          {{SensorFaultKind::offset, 0.0, -90.0}, 0.0},
      };
      for (const auto& [fault, volts] : faulty) {
        std::array<SensorFault, 2> faults{};
        faults[which] = fault;
        const auto found = volts_of(p, faults, angle);
        EXPECT_NEAR(found[which], volts, p.lsb_v()) << static_cast<int>(fault.kind) << ' ' << fault.size;
        EXPECT_NEAR(found[1 - which], clean(p, 1 - which, angle), p.lsb_v());
      }
    }
  }
}

TEST(SensorEquations, AFaultBeginsAtItsTime) {
  const SensorPair p = exact_pair();
  SensorSampler late(p, sample_s, 3, {SensorFault{SensorFaultKind::offset, 3 * sample_s, 0.2}, SensorFault{}});
  SensorSampler stuck(p, sample_s, 3, {SensorFault{}, SensorFault{SensorFaultKind::stuck, 2 * sample_s, 0.0}});
  for (int k = 0; k < 6; ++k) {
    const double angle = 10.0 + 4.0 * k;
    EXPECT_NEAR(late.step(angle).volts[0], clean(p, 0, angle) + (k >= 3 ? 0.2 : 0.0), p.lsb_v()) << k;
    EXPECT_NEAR(stuck.step(angle).volts[1], clean(p, 1, k >= 2 ? 18.0 : angle), p.lsb_v()) << k;
  }
}

TEST(SensorEquations, FilterNoiseAndConverterStandInThisOrder) {
  const SensorPair p = other_pair();
  SensorSampler sampler(p, sample_s, 9, {});
  std::array<double, 2> held{};
  const double lsb = 5.2 / 2048.0;
  for (std::uint64_t k = 0; k < 200; ++k) {
    const double angle = 40.0 + 35.0 * std::sin(0.1 * static_cast<double>(k));
    const SensorReading r = sampler.step(angle);
    for (std::size_t i = 0; i < 2; ++i) {
      const double v = clean(p, i, angle);
      held[i] = k == 0 ? v : held[i] + (1.0 - std::exp(-2e-3 / 3e-3)) * (v - held[i]);
      const double noisy = held[i] + 0.011 * random::normal(9, i, k);
      ASSERT_NEAR(r.volts[i], std::round(noisy / lsb) * lsb, 1e-9) << k;
      ASSERT_NEAR(sampler.state().filtered_v[i], held[i], 1e-12) << k;
    }
    ASSERT_NEAR(r.sum_error_v, r.volts[0] + r.volts[1] - 5.2, 1e-12);
    ASSERT_NEAR(r.angle_deg, (r.volts[0] - 0.7) / 3.4 * 84.0, 1e-9);
    ASSERT_EQ(sampler.state().sample, static_cast<std::int64_t>(k) + 1);
  }
}

TEST(SensorEquations, TheAngleIsThatOfTheFirstUnlessOnlyTheFirstIsOutOfRange) {
  const SensorPair p = exact_pair();
  const auto angle = [&](const std::array<SensorFault, 2>& faults) {
    return SensorSampler(p, sample_s, 3, faults).step(30.0).angle_deg;
  };
  const SensorFault short_circuit{SensorFaultKind::short_to_ground};
  const SensorFault offset{SensorFaultKind::offset, 0.0, 0.34};
  EXPECT_NEAR(angle({SensorFault{}, short_circuit}), 30.0, 1e-3);
  EXPECT_NEAR(angle({short_circuit, SensorFault{}}), 30.0, 1e-3);
  EXPECT_NEAR(angle({offset, SensorFault{}}), 30.0 + 8.4, 1e-3) << "in range: the first is believed";
  EXPECT_NEAR(angle({short_circuit, offset}), 30.0 - 8.4, 1e-3);
  EXPECT_NEAR(angle({short_circuit, short_circuit}), -0.7 / 3.4 * 84.0, 1e-3) << "both out of range";
}

TEST(SensorEquations, RangeAndSumHaveTheirEdges) {
  SensorPair p = exact_pair();
  p.sum_tolerance_v = 5.0;
  const auto reading = [&](double first_v, double second_v) {
    const double v1 = clean(p, 0, 40.0), v2 = clean(p, 1, 40.0);
    return SensorSampler(p, sample_s, 3,
                         {SensorFault{SensorFaultKind::offset, 0.0, first_v - v1},
                          SensorFault{SensorFaultKind::offset, 0.0, second_v - v2}})
        .step(40.0);
  };
  using Faults = std::array<bool, 2>;
  EXPECT_EQ(reading(0.351, 2.0).range_fault, (Faults{false, false}));
  EXPECT_EQ(reading(0.349, 2.0).range_fault, (Faults{true, false}));
  EXPECT_EQ(reading(2.0, 0.349).range_fault, (Faults{false, true}));
  EXPECT_EQ(reading(4.599, 2.0).range_fault, (Faults{false, false}));
  EXPECT_EQ(reading(4.601, 2.0).range_fault, (Faults{true, false}));
  EXPECT_EQ(reading(2.0, 4.601).range_fault, (Faults{false, true}));
  p.sum_tolerance_v = 0.31;
  for (const double side : {1.0, -1.0}) {
    EXPECT_FALSE(reading(2.6 + side * 0.309, 2.6).sum_fault) << side;
    EXPECT_TRUE(reading(2.6, 2.6 + side * 0.311).sum_fault) << side;
  }
  p.sum_tolerance_v = 0.0;
  EXPECT_TRUE(reading(2.6, 2.6).sum_fault) << "at the tolerance it fails";
}

// 0.01 s of samples of 2 ms: the fifth failing sample in a row, whichever check fails, and for good.
TEST(SensorEquations, TheFaultStandsAfterTheDebounceTimeOfEachCheck) {
  const SensorFault none{};
  const SensorFault sum{SensorFaultKind::offset, 2 * sample_s, 0.4};
  const SensorFault range{SensorFaultKind::open_wire, 2 * sample_s, 0.0};
  for (const auto& faults : {std::array{sum, none}, {none, sum}, {range, none}, {none, range}}) {
    SensorSampler sampler(exact_pair(), sample_s, 3, faults);
    for (int k = 0; k < 12; ++k) {
      const bool fault = sampler.step(30.0).fault;
      EXPECT_EQ(fault, k >= 6) << k;
      EXPECT_EQ(sampler.state().failing, k < 2 ? 0 : std::min(k - 1, 5)) << k;
    }
  }
  SensorPair at_once = exact_pair();
  at_once.debounce_s = 0.0;
  SensorSampler sampler(at_once, sample_s, 3, {range, none});
  for (int k = 0; k < 4; ++k)
    EXPECT_EQ(sampler.step(30.0).fault, k >= 2) << k;
}

// The domains of the fields are those of the records: tests/python/test_bad_input_engine.py.
TEST(SensorEquations, RulesBetweenSettings) {
  for (const auto& [member, volts] : {std::pair{&SensorPair::closed_v, 5.3}, std::pair{&SensorPair::span_v, 4.51},
                                      std::pair{&SensorPair::noise_v, 5.3},
                                      std::pair{&SensorPair::sum_tolerance_v, 5.3}, std::pair{&SensorPair::low_v, 5.3},
                                      std::pair{&SensorPair::high_v, 0.34}, std::pair{&SensorPair::high_v, 5.3}}) {
    SensorPair p = other_pair();
    EXPECT_NO_THROW(validate(p));
    p.*member = volts;
    EXPECT_THROW(validate(p), ParameterError) << volts;
  }
  SensorPair edge = other_pair();
  edge.span_v = 4.5;  // with closed_v exactly the supply
  EXPECT_NO_THROW(validate(edge));
  const auto fault = [](SensorFaultKind kind, double size, double from_s = 0.0) {
    return [=] { validate(SensorFault{kind, from_s, size}); };
  };
  EXPECT_NO_THROW(fault(SensorFaultKind::offset, -100.0)());
  EXPECT_THROW(fault(SensorFaultKind::offset, 100.1)(), ParameterError);
  EXPECT_THROW(fault(SensorFaultKind::offset, -100.1)(), ParameterError);
  EXPECT_NO_THROW(fault(SensorFaultKind::gain, -1.0)());
  EXPECT_NO_THROW(fault(SensorFaultKind::gain, 10.0)());
  EXPECT_THROW(fault(SensorFaultKind::gain, -1.1)(), ParameterError);
  EXPECT_THROW(fault(SensorFaultKind::gain, 10.1)(), ParameterError);
  EXPECT_NO_THROW(fault(SensorFaultKind::stuck, 1e6)()) << "its size is not used";
  EXPECT_THROW(fault(SensorFaultKind::none, 0.0, -1.0)(), ParameterError);
  EXPECT_THROW(SensorSampler(other_pair(), 0.9e-5, 0, {}), ParameterError);
  EXPECT_THROW(SensorSampler(other_pair(), 1.1, 0, {}), ParameterError);
  EXPECT_NO_THROW(SensorSampler(other_pair(), 1.0, 0, {}));
}

constexpr double quick_s = 1e-3;
constexpr std::array<SensorFault, 2> healthy{};

std::array<SensorFault, 2> first(SensorFaultKind kind, double size = 0.0, double from_s = 0.0) {
  return {SensorFault{kind, from_s, size}, SensorFault{}};
}

TEST(Sensors, ShortFailureIsForgotten) {
  SensorSampler sampler(SensorPair{}, quick_s, 1, healthy);
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
  SensorSampler faulty(SensorPair{}, quick_s, 1, first(SensorFaultKind::offset, 0.2, 0.0));
  SensorSampler smaller(SensorPair{}, quick_s, 1, first(SensorFaultKind::offset, 0.19, 0.0));
  int k = 0;
  for (; k < 5000 && !faulty.step(30.0).fault; ++k)
    ASSERT_FALSE(smaller.step(30.0).fault);
  EXPECT_LT(k, 2000);
}

}  // namespace
}  // namespace mgdd::throttle
