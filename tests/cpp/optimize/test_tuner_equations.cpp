// The tuner against its closed forms, number by number, for wishes that leave nothing at its default.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/optimize/seekers/tuner.hpp"

namespace mgdd::optimize {
namespace {

TuningSpec full_wish(TunedMethod method) {
  TuningSpec w;
  w.method = method;
  w.noise_sd = 0.31;
  w.curvature = -0.083;
  w.rms = 0.9;
  w.cycles = 240.0;
  w.distance = 9.0;
  w.arrival = 0.8;
  w.amplitude_max = 2.6;
  return w;
}

struct Dithered {
  int period;
  double tau_least, gain, phase;  // of the sensor at the dither
};

double told(std::optional<double> wish) {
  return wish.value_or(std::nan(""));
}

void expect_dithered(const TuningSpec& w, const Dithered& known) {
  const Tuning t = tune(w);
  const bool batch = w.method == TunedMethod::batch;
  const double bend = std::abs(w.curvature);
  EXPECT_EQ(t.method, w.method);
  EXPECT_EQ(t.period, known.period);
  EXPECT_NEAR(t.sensor_gain, known.gain, 1e-9);
  EXPECT_NEAR(t.sensor_phase_rad, known.phase, 1e-9);
  const double echo = w.compensated ? known.gain : known.gain * std::cos(known.phase);
  const double decades = std::log(told(w.distance) / told(w.arrival));
  const double tau = std::max(known.tau_least, (0.85 * told(w.cycles) - known.period) / decades);
  EXPECT_NEAR(t.time_constant_cycles, tau, 1e-9);
  const double stepping = batch ? std::sqrt(1.0 - known.period / (2.0 * tau)) : 1.0;
  const double unit = w.noise_sd / (echo * bend * std::sqrt(tau) * stepping);  // rms at an amplitude of one
  EXPECT_NEAR(t.amplitude, std::min(told(w.amplitude_max), unit / told(w.rms)), 1e-9);
  EXPECT_NEAR(t.rms, unit / t.amplitude, 1e-9);
  EXPECT_NEAR(t.gain, 2.0 / (t.amplitude * bend * tau) / (w.compensated ? 1.0 : echo), 1e-9);
  EXPECT_NEAR(t.rate, (batch ? 1.0 : 3.0) * t.amplitude / known.period, 1e-12);
  const double linear = std::clamp(t.rate * tau, told(w.arrival), told(w.distance));
  EXPECT_NEAR(t.cycles, known.period + (told(w.distance) - linear) / t.rate + tau * std::log(linear / told(w.arrival)),
              1e-9);
  EXPECT_NEAR(t.dither_cost, 0.5 * bend * 0.5 * t.amplitude * t.amplitude, 1e-12);
  EXPECT_NEAR(t.jitter_cost, 0.5 * bend * t.rms * t.rms, 1e-12);
  EXPECT_EQ(t.met, t.rms <= told(w.rms) * (1.0 + 1e-9) && t.cycles <= told(w.cycles));
}

TEST(TunerEquations, ADitherWithoutLag) {
  expect_dithered(full_wish(TunedMethod::batch), {6, 12.0, 1.0, 0.0});
  expect_dithered(full_wish(TunedMethod::moving_average), {10, 20.0, 1.0, 0.0});
  for (const TunedMethod method : {TunedMethod::batch, TunedMethod::moving_average}) {
    TuningSpec short_wish = full_wish(method);
    short_wish.cycles = 30.0;  // then the least time constant holds, and the wish is not met
    expect_dithered(short_wish,
                    method == TunedMethod::batch ? Dithered{6, 12.0, 1.0, 0.0} : Dithered{10, 20.0, 1.0, 0.0});
    EXPECT_FALSE(tune(short_wish).met);
    short_wish.amplitude_max = 1e9;  // an amplitude may stay below its bound
    short_wish.rms = 4.0;
    expect_dithered(short_wish,
                    method == TunedMethod::batch ? Dithered{6, 12.0, 1.0, 0.0} : Dithered{10, 20.0, 1.0, 0.0});
    EXPECT_LT(tune(short_wish).amplitude, 1.5);
  }
}

TEST(TunerEquations, ADitherBehindALag) {
  TuningSpec w = full_wish(TunedMethod::batch);
  w.cycles = 900.0;
  w.delay_uncertainty = 0.0;
  w.lag = {7.0, 11.0};
  const SensorResponse known = sensor_response(w.lag, 1, 27);  // 2.4 x 11 cycles, rounded up
  expect_dithered(w, {27, 108.0, known.gain, known.phase_rad});
  w.lag = {70.0, 1.0};
  const SensorResponse late = sensor_response(w.lag, 1, 6);
  expect_dithered(w, {6, 213.0, late.gain, late.phase_rad});  // three delays per time constant
  w.cycles = 30.0;
  w.lag = {0.0, 0.8};  // a lag below one cycle is one too
  const SensorResponse quick = sensor_response(w.lag, 1, 6);
  expect_dithered(w, {6, 24.0, quick.gain, quick.phase_rad});
  w.cycles = 900.0;
  w.lag = {7.0, 11.0};
  w.compensated = false;
  const SensorResponse blind = sensor_response(w.lag, 1, 108);  // six of both
  expect_dithered(w, {108, 216.0, blind.gain, blind.phase_rad});
  w.method = TunedMethod::moving_average;
  EXPECT_THROW(tune(w), ParameterError);
  w.compensated = true;
  const SensorResponse same = sensor_response(w.lag, 1, 27);
  expect_dithered(w, {27, 108.0, same.gain, same.phase_rad});
  w.compensated = false;
  w.lag = {};
  expect_dithered(w, {10, 20.0, 1.0, 0.0});
}

TEST(TunerEquations, ADoubtOfTheDelayLengthensThePeriod) {
  TuningSpec w = full_wish(TunedMethod::batch);
  w.cycles = 900.0;
  const auto period_is = [&w](const ComponentLag& lag, int period) {
    w.lag = lag;
    const SensorResponse r = sensor_response(lag, 1, period);
    const double whole = lag.delay_cycles + lag.lag_cycles;
    const double tau_least = std::max((w.compensated ? 4.0 : 2.0) * period, 3.0 * (whole + tune(w).delay_uncertainty));
    expect_dithered(w, {period, tau_least, r.gain, r.phase_rad});
  };
  period_is({5.0, 0.0}, 12);    // two cycles at least
  period_is({38.0, 25.0}, 76);  // a fifth of 63
  period_is({1.0, 40.0}, 96);   // 2.4 x 40 is longer than six fifths of 41
  w.delay_uncertainty = 0.7;
  period_is({70.0, 0.0}, 6);
  w.delay_uncertainty = 4.3;
  period_is({70.0, 0.0}, 26);
  w.method = TunedMethod::moving_average;
  w.delay_uncertainty = 1.5;
  period_is({5.0, 0.0}, 10);
  w.method = TunedMethod::batch;
  w.compensated = false;
  period_is({5.0, 3.0}, 57);
  w = full_wish(TunedMethod::spsa);
  w.delay_uncertainty = 1.0;
  EXPECT_THROW(tune(w), ParameterError);
}

TEST(TunerEquations, SpsaWithAConstantGain) {
  for (const double cycles : {240.0, 4.0}) {  // the second asks for more than half of the way per iteration
    TuningSpec w = full_wish(TunedMethod::spsa);
    w.cycles = cycles;
    const Tuning t = tune(w);
    const double q = std::min(0.5, 1.0 - std::pow(0.8 / 9.0, 2.0 / (0.85 * cycles)));
    const double unit = 0.31 / 0.083 * std::sqrt(q / (2.0 * (2.0 - q)));
    EXPECT_EQ(t.method, TunedMethod::spsa);
    EXPECT_EQ(t.period, 2);
    EXPECT_NEAR(t.amplitude, std::min(2.6, unit / 0.9), 1e-9);
    EXPECT_NEAR(t.gain, q / 0.083, 1e-9);
    EXPECT_NEAR(t.rate, std::max(2.0 * t.amplitude, 1.2 * q * 9.0), 1e-9);
    EXPECT_NEAR(t.time_constant_cycles, -2.0 / std::log(1.0 - q), 1e-9);
    EXPECT_NEAR(t.cycles, 2.0 * std::log(0.8 / 9.0) / std::log(1.0 - q), 1e-9);
    EXPECT_NEAR(t.rms, unit / t.amplitude, 1e-9);
    EXPECT_NEAR(t.dither_cost, 0.5 * 0.083 * t.amplitude * t.amplitude, 1e-12);
    EXPECT_NEAR(t.jitter_cost, 0.5 * 0.083 * t.rms * t.rms, 1e-12);
    EXPECT_EQ(t.met, t.reasons.empty());
    EXPECT_EQ(t.reasons.empty(), t.cycles <= cycles && t.rms <= 0.9 * (1.0 + 1e-9));
  }
  TuningSpec late = full_wish(TunedMethod::spsa);
  late.lag.delay_cycles = 1.0;
  EXPECT_THROW(tune(late), ParameterError);
}

TEST(TunerEquations, WhatIsLeftOpenScalesWithTheLengthOfTheNoise) {
  for (const TunedMethod method : {TunedMethod::batch, TunedMethod::moving_average, TunedMethod::spsa}) {
    TuningSpec open;
    open.method = method;
    open.noise_sd = 0.4;
    open.curvature = 0.1;
    const double length = 2.0;
    TuningSpec said = open;
    said.rms = 0.2 * length;
    said.distance = 5.0 * length;
    said.arrival = 0.45 * length;
    said.amplitude_max = 1.8 * length;
    said.cycles = 50.0;
    const Tuning a = tune(open), b = tune(said);
    EXPECT_EQ(a.amplitude, b.amplitude) << name_of(method);
    EXPECT_EQ(a.gain, b.gain);
    EXPECT_EQ(a.rate, b.rate);
    EXPECT_EQ(a.cycles, b.cycles);
    EXPECT_EQ(a.rms, b.rms);
  }
  TuningSpec open;  // behind a lag the cycles follow from the least time constant
  open.noise_sd = 0.4;
  open.curvature = 0.1;
  open.lag = {7.0, 11.0};
  open.delay_uncertainty = 0.0;
  const Tuning t = tune(open);
  EXPECT_NEAR(t.time_constant_cycles, 108.0, 1e-9);
}

}  // namespace
}  // namespace mgdd::optimize
