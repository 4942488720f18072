// The tuner: its closed forms, the seekers that it makes, and its plain word where a wish cannot be met.
#include "mgdd/optimize/seekers/tuner.hpp"

#include "support/lagged_sensor.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

constexpr double sigma = 0.25;

TuningSpec default_wish(TunedMethod method = TunedMethod::batch) {
  TuningSpec w;
  w.method = method;
  w.noise_sd = sigma;
  w.curvature = bend;
  w.distance = 12.0;
  w.arrival = 1.0;
  return w;
}

Seeker seeker_of(const Tuning& t, double start, std::uint64_t seed, const ComponentLag& lag = {}) {
  if (t.method == TunedMethod::spsa) {
    SpsaSettings s;
    s.space = space_at(scalar_input(start));
    s.schedule = GainSchedule::constant;
    s.gain = scalar_input(t.gain);
    s.perturbation = scalar_input(t.amplitude);
    s.step_max = scalar_input(t.rate);
    s.seed = seed;
    return Spsa(s);
  }
  ExtremumSeekingSettings s;
  s.space = space_at(scalar_input(start));
  s.form = t.method == TunedMethod::batch ? MeanRemoval::batch : MeanRemoval::moving_average;
  s.dither = {.amplitude = scalar_input(t.amplitude), .period = t.period, .harmonics = {1}};
  s.gain = scalar_input(t.gain);
  s.rate = scalar_input(t.rate);
  s.components = {lag};
  return ExtremumSeeking(s);
}

TEST(Tuner, WhatItPredictsHappens) {
  for (const TunedMethod method : {TunedMethod::batch, TunedMethod::moving_average, TunedMethod::spsa}) {
    TuningSpec w = default_wish(method);
    w.cycles = 100.0;
    const Tuning t = tune(w);
    EXPECT_TRUE(t.met);
    double cycles = 0.0, square = 0.0;
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      Seeker any = seeker_of(t, seed % 2 == 0 ? 12.0 : -12.0, seed);
      const std::vector<double> path =
          std::visit([&](auto& seeker) { return search(seeker, quadratic, 2400, sigma, seed); }, any);
      cycles += first_within(path, 1.0) / 200.0;
      square += std::pow(rms_of(path, 400, 2400), 2) / 200.0;
    }
    EXPECT_NEAR(std::sqrt(square) / t.rms, 1.0, 0.15) << name_of(method);
    EXPECT_NEAR(cycles / t.cycles, 1.0, 0.25) << name_of(method);
    EXPECT_LE(cycles, 100.0) << name_of(method);
  }
}

TEST(Tuner, AKnownLagIsTurnedBackAndArrives) {
  TuningSpec w = default_wish();
  w.lag = {38.0, 25.0};
  const Tuning t = tune(w);
  EXPECT_GE(t.period, 60);
  EXPECT_GE(t.time_constant_cycles, 4.0 * t.period);
  EXPECT_NEAR(t.sensor_gain, sensor_response(w.lag, 1, t.period).gain, 1e-12);
  for (const double start : {12.0, -12.0}) {
    Seeker any = seeker_of(t, start, 0, w.lag);
    test_support::LaggedSensor sensor(38, 25.0, quadratic(start));
    const auto late = [&](double x) { return sensor.show(quadratic(x)); };
    const std::vector<double> path =
        std::visit([&](auto& seeker) { return search(seeker, late, static_cast<int>(8.0 * t.cycles)); }, any);
    EXPECT_NEAR(first_within(path, 1.0) / t.cycles, 0.85, 0.35);
    EXPECT_LT(std::abs(path.back()), 0.3);
    EXPECT_LT(rms_of(path, path.size() / 2, path.size()), 0.5);
  }
}

TEST(Tuner, AnUnknownLagAsksForADitherSlowEnoughToKeepTheSign) {
  TuningSpec w = default_wish();
  w.lag = {38.0, 25.0};
  w.compensated = false;
  const Tuning t = tune(w);
  EXPECT_GE(t.period, 6 * (38 + 25));
  EXPECT_LT(t.sensor_phase_rad, pi / 3.0 + 0.02);
  const Tuning compensated = [&] {
    w.compensated = true;
    return tune(w);
  }();
  EXPECT_GT(t.cycles, 3.0 * compensated.cycles);
}

/// Largest distance from the optimum over the last quarter of a run whose sensor is later than the seeker believes.
double lost_by(const Tuning& t, const ComponentLag& believed, int delay, double lag, std::uint64_t seed) {
  const double start = seed % 2 == 0 ? 12.0 : -12.0;
  Seeker any = seeker_of(t, start, seed, believed);
  test_support::LaggedSensor sensor(delay, lag, quadratic(start));
  const auto late = [&](double x) { return sensor.show(quadratic(x)); };
  const int cycles = static_cast<int>(6.0 * t.cycles);
  const std::vector<double> path = std::visit([&](auto& s) { return search(s, late, cycles, sigma, seed); }, any);
  double farthest = 0.0;
  for (std::size_t k = path.size() - path.size() / 4; k < path.size(); ++k)
    farthest = std::max(farthest, std::abs(path[k]));
  return farthest;
}

TEST(Tuner, ADelayKnownToTwoCyclesLosesNoRun) {
  for (const TunedMethod method : {TunedMethod::batch, TunedMethod::moving_average}) {
    for (const int delay : {5, 10, 20}) {
      TuningSpec w = default_wish(method);
      w.lag = {static_cast<double>(delay), 0.0};
      const Tuning t = tune(w);
      for (const int error : {-2, 0, 2}) {
        for (std::uint64_t seed = 0; seed < 20; ++seed) {
          EXPECT_LT(lost_by(t, w.lag, delay + error, 0.0, seed), 6.0)
              << name_of(method) << " delay " << delay << " error " << error << " seed " << seed;
        }
      }
    }
  }
}

TEST(Tuner, ALagKnownToAFifthLosesNoRun) {
  for (const TunedMethod method : {TunedMethod::batch, TunedMethod::moving_average}) {
    for (const ComponentLag believed : {ComponentLag{0.0, 4.0}, {5.0, 10.0}, {38.0, 25.0}}) {
      TuningSpec w = default_wish(method);
      w.lag = believed;
      const Tuning t = tune(w);
      const double off = t.delay_uncertainty;
      EXPECT_NEAR(off, std::max(2.0, 0.2 * (believed.delay_cycles + believed.lag_cycles)), 1e-12);
      for (const double share : {-1.0, 1.0}) {  // all of the error in the lag, then as much as can be in the delay
        const double lag = std::max(0.0, believed.lag_cycles + share * off);
        const SensorResponse thought = sensor_response(believed, 1, t.period);
        const SensorResponse real = sensor_response({believed.delay_cycles, lag}, 1, t.period);
        EXPECT_LT(std::abs(real.phase_rad - thought.phase_rad), pi / 3.0);
        const int delay = static_cast<int>(std::max(0.0, std::trunc(believed.delay_cycles + share * off)));
        for (std::uint64_t seed = 0; seed < 10; ++seed) {
          EXPECT_LT(lost_by(t, believed, static_cast<int>(believed.delay_cycles), lag, seed), 6.0);
          EXPECT_LT(lost_by(t, believed, delay, believed.lag_cycles, seed), 6.0);
        }
      }
    }
  }
}

TEST(Tuner, AnExactDelayKeepsItsShortPeriod) {
  TuningSpec w = default_wish();
  w.lag = {10.0, 0.0};
  w.delay_uncertainty = 0.0;
  EXPECT_EQ(tune(w).period, 6);
  w.delay_uncertainty = 3.0;
  EXPECT_EQ(tune(w).period, 18);
  w.compensated = false;
  EXPECT_EQ(tune(w).period, 6 * (10 + 3));
  w = default_wish();  // nobody said delay: none is provided for, unless asked
  EXPECT_EQ(tune(w).period, 6);
  EXPECT_EQ(tune(w).delay_uncertainty, 0.0);
  w.delay_uncertainty = 2.0;
  EXPECT_EQ(tune(w).period, 12);
}

TEST(Tuner, SaysPlainlyWhatCannotBeMet) {
  TuningSpec w = default_wish();
  w.cycles = 10.0;
  Tuning t = tune(w);
  EXPECT_FALSE(t.met);
  ASSERT_EQ(t.reasons.size(), 1u);
  EXPECT_NE(t.reasons[0].find("cycles = 10 is too few"), std::string::npos);
  w = default_wish();
  w.rms = 0.05;
  w.amplitude_max = 1.0;
  t = tune(w);
  EXPECT_FALSE(t.met);
  EXPECT_NE(t.reasons.back().find("rms = 0.05 is out of reach with amplitude_max = 1"), std::string::npos);
  w.amplitude_max = 1.01 * t.amplitude * t.rms / 0.05;  // the amplitude that its sentence asks for
  EXPECT_TRUE(tune(w).met);
}

TEST(Tuner, RefusesByName) {
  const auto message = [](auto change) -> std::string {
    TuningSpec w = default_wish();
    change(w);
    try {
      tune(w);
    } catch (const ParameterError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message([](auto& w) { w.noise_sd = 0.0; }).find("noise_sd = 0"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.curvature = std::nan(""); }).find("curvature| = nan"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.rms = -1.0; }).find("rms = -1"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.cycles = 0.0; }).find("cycles = 0"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.arrival = 12.0; }).find("must be below distance = 12"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.lag.delay_cycles = -1.0; }).find("delay_cycles = -1"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.delay_uncertainty = -0.5; }).find("delay_uncertainty = -0.5"), std::string::npos);
  EXPECT_NE(message([](auto& w) { w.delay_uncertainty = unlimited; }).find("delay_uncertainty = inf"),
            std::string::npos);
  EXPECT_NE(message([](auto& w) {
              w.method = TunedMethod::spsa;
              w.lag.lag_cycles = 5.0;
            }).find("without delay and lag"),
            std::string::npos);
}

}  // namespace
}  // namespace mgdd::optimize
