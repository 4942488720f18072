// Laws of the online calibration: it finds the wall heat of a known engine by every method, its standard errors hold,
// and what it cannot know it says.
#include "mgdd/guide/online_calibration.hpp"

#include "mgdd/common/random.hpp"
#include "support/calibration_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

using test_support::run;
using test_support::steady_bench;
using test_support::sure_of_the_engine;
using test_support::sure_of_the_rest;
using test_support::wall;
using test_support::wrong_guide;

constexpr CalibrationMethod every_method[] = {CalibrationMethod::extremum_seeking, CalibrationMethod::gauss_newton,
                                              CalibrationMethod::recursive};

TEST(OnlineCalibration, EveryMethodFindsTheWallHeatOfACleanEngine) {
  for (const CalibrationMethod method : every_method) {
    for (const double start : {1.0, 0.25, 2.0}) {
      loop::VirtualEngine bench(steady_bench());
      OnlineCalibration calibration(sure_of_the_rest(wrong_guide(method, start)));
      run(bench, calibration, 120);
      EXPECT_NEAR(calibration.parameters()[wall], 0.5, 0.01) << name_of(method) << " from " << start;
      EXPECT_TRUE(calibration.determined()) << calibration.explain(wall);
      EXPECT_EQ(calibration.cylinder().wall_heat.wall_heat_scale, calibration.parameters()[wall]);
      engine::Cylinder rest = calibration.cylinder();
      rest.wall_heat.wall_heat_scale = 0.5;
      EXPECT_EQ(rest, engine::Cylinder{});
    }
  }
}

// Acceptance fact 33: 0.5 CAD of SOC shifts a wall heat that is fitted alone.
TEST(OnlineCalibration, AWrongTimingShiftsAWallHeatThatIsFittedAlone) {
  const struct {
    double soc, shift;
  } known[] = {{-6.0, 0.075}, {-10.0, 0.053}, {0.0, 0.114}};
  for (const auto& [soc, shift] : known) {
    for (const double error : {0.5, -0.5}) {
      loop::VirtualEngine bench(steady_bench());
      OnlineCalibration calibration(sure_of_the_rest(wrong_guide(CalibrationMethod::gauss_newton)));
      run(bench, calibration, 40, soc, error);
      EXPECT_NEAR(calibration.parameters()[wall] - 0.5, error > 0.0 ? -shift : shift, 0.02) << soc << " " << error;
    }
  }
}

// A sensor that errs: the bias of the wall heat stays below 5 %, or the verdict says that it is not known.
TEST(OnlineCalibration, ErrorsOfTheSensorAreSeenOrSaid) {
  const auto with = [](double tdc, double gain, double offset, double noise) {
    loop::BenchSettings s = steady_bench(noise, 5);
    s.pressure.tdc_error_cad = tdc;
    s.pressure.gain_error = gain;
    s.pressure.offset_bar = offset;
    return s;
  };
  for (const CalibrationMethod method : every_method) {
    for (const double noise : {0.02, 0.1, 0.5}) {
      for (const auto& s : {with(0.5, 0.0, 0.0, noise), with(-0.5, 0.0, 0.0, noise), with(0.0, 0.01, 0.0, noise),
                            with(0.0, -0.01, 0.0, noise), with(0.0, 0.0, 0.1, noise), with(0.3, 0.005, -0.1, noise)}) {
        loop::VirtualEngine bench(s);
        OnlineCalibration calibration(sure_of_the_engine(wrong_guide(method)));
        run(bench, calibration, 150);
        const double bias = calibration.parameters()[wall] / 0.5 - 1.0;
        EXPECT_TRUE(std::abs(bias) < 0.05 || !calibration.determined())
            << name_of(method) << " tdc " << s.pressure.tdc_error_cad << " gain " << s.pressure.gain_error << " noise "
            << noise << " " << calibration.explain(wall);
        if (method != CalibrationMethod::extremum_seeking && noise < 0.2) {
          EXPECT_LT(std::abs(bias), 0.05) << calibration.explain(wall);
          EXPECT_TRUE(calibration.determined()) << calibration.explain(wall);
        }
      }
    }
  }
}

TEST(OnlineCalibration, ExtremumSeekingSaysWhatItCannotKnow) {
  loop::VirtualEngine bench(steady_bench(0.1));
  OnlineCalibration calibration(wrong_guide(CalibrationMethod::extremum_seeking));
  run(bench, calibration, 100);
  EXPECT_FALSE(calibration.determined());
  EXPECT_NE(calibration.explain(wall).find("gamma_offset"), std::string::npos) << calibration.explain(wall);
}

// A plant of another structure: whatever comes out, it is not called determined.
TEST(OnlineCalibration, AModelOfAnotherShapeIsNotBelieved) {
  for (const CalibrationMethod method : every_method) {
    for (int kind = 0; kind < 3; ++kind) {
      loop::BenchSettings s = steady_bench(0.05);
      if (kind == 0) s.cylinder.burn.burn_shape = engine::BurnShape::wiebe;
      if (kind == 1) s.cylinder.gas.gamma_model = engine::GammaModel::linear;
      if (kind == 2) {
        s.cylinder.burn.burn_shape = engine::BurnShape::double_wiebe;
        s.cylinder.wall_heat.wall_heat_scale = 0.0;
      }
      loop::VirtualEngine bench(s);
      OnlineCalibration calibration(wrong_guide(method));
      run(bench, calibration, 150);
      EXPECT_FALSE(calibration.determined()) << name_of(method) << kind << " " << calibration.explain(wall);
      EXPECT_EQ(calibration.jumps(), 0) << name_of(method) << kind;  // a misfit that stays is not a change
    }
  }
}

struct Coverage {
  double within_95 = 0.0, spread = 0.0;
};
// Errors over stated standard errors, 100 seeds; what is off of sensor, engine and fuel is drawn from what is known of
// it.
Coverage coverage_of(CalibrationMethod method, double noise_bar, double correlation, int cycles) {
  constexpr int seeds = 100;
  Coverage out;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    const auto drawn = [&](std::uint64_t of) { return random::normal(seed, 77, of); };
    loop::BenchSettings s = steady_bench(0.0, seed);
    s.pressure.tdc_error_cad = std::clamp(0.3 * drawn(0), -2.0, 2.0);
    s.pressure.gain_error = 0.005 * drawn(1);
    s.pressure.offset_bar = 0.1 * drawn(2);
    s.cylinder.gas.gamma += 0.01 * drawn(3);
    s.schedule[0].point.fuel_mg *= 1.0 + 0.02 * drawn(4);
    s.schedule[0].point.burn_duration_cad = 30.0 * (1.0 + 0.05 * drawn(5));
    s.cylinder.geometry.compression_ratio += 0.1 * drawn(7);
    s.cylinder.wall_heat.wall_temperature_k += 70.0 * drawn(8);
    s.schedule[0].point.intake_temperature_k += 10.0 * drawn(9);
    loop::VirtualEngine bench(s);
    OnlineCalibration calibration(wrong_guide(method, 0.8));
    std::vector<double> shown;
    for (int k = 0; k < cycles; ++k) {
      bench.step(-6.0);
      const auto trace = bench.pressure().pressure_bar;
      shown.assign(trace.begin(), trace.end());
      double noise = 0.0;
      for (std::size_t i = 0; i < shown.size(); ++i) {
        const double own = random::normal(seed, 78, static_cast<std::uint64_t>(k) * 1000 + i);
        noise = i == 0 ? own : correlation * noise + std::sqrt(1.0 - correlation * correlation) * own;
        shown[i] += noise_bar * noise;
      }
      engine::OperatingPoint told;
      told.burn_duration_cad = 30.0;
      calibration.offer(shown, told, -6.0 + 0.3 * drawn(6));
      calibration.update();
    }
    const double error = calibration.parameters()[wall] - 0.5;
    const double z = error / calibration.standard_errors()[wall];
    out.within_95 += std::abs(z) < 1.96 ? 1.0 / seeds : 0.0;
    out.spread += z * z / seeds;
  }
  out.spread = std::sqrt(out.spread);
  return out;
}

TEST(OnlineCalibration, StandardErrorsHoldForWhiteAndForCorrelatedNoise) {
  for (const CalibrationMethod method : {CalibrationMethod::gauss_newton, CalibrationMethod::recursive}) {
    for (const auto& [noise, correlation] : {std::pair{0.1, 0.0}, {0.5, 0.0}, {0.3, 0.5}, {0.3, 0.9}}) {
      const Coverage c = coverage_of(method, noise, correlation, 40);
      EXPECT_GT(c.within_95, 0.88) << name_of(method) << noise << correlation;  // 0.95 less three of 0.022
      EXPECT_LT(c.spread, correlation == 0.0 ? 1.2 : 1.25) << name_of(method) << noise << correlation;
      EXPECT_TRUE(correlation > 0.0 || c.spread > 0.7) << name_of(method) << noise;
    }
  }
}

// Fuel and burn of each point are off by another share; what belongs to the sensor is learnt over both.
TEST(OnlineCalibration, WhatBelongsToAPointIsForgottenWithIt) {
  loop::BenchSettings s = steady_bench(0.3, 6);
  s.pressure.tdc_error_cad = 0.4;
  s.pressure.gain_error = -0.004;
  engine::OperatingPoint low, high;
  low.fuel_mg = 20.0 * 1.03;
  high.fuel_mg = 28.0 * 0.975;
  low.burn_duration_cad = 31.0;
  high.burn_duration_cad = 33.5;
  s.schedule = {{0, low}, {150, high}};
  loop::VirtualEngine bench(s);
  OnlineCalibration calibration(wrong_guide(CalibrationMethod::recursive));
  const auto drive = [&](int cycles, double fuel, double duration) {
    engine::OperatingPoint told;
    told.fuel_mg = fuel;
    told.burn_duration_cad = duration;
    for (int k = 0; k < cycles; ++k) {
      bench.step(-6.0);
      calibration.offer(bench.pressure().pressure_bar, told, -6.2);
      calibration.update();
    }
  };
  drive(150, 20.0, 30.0);
  EXPECT_NEAR(calibration.parameters()[Calibrated::fuel_heat], 1.03, 0.012);
  const CalibrationVector before = calibration.standard_errors();
  drive(20 + 10, 28.0, 35.0);  // 20 cycles of waiting and one window
  const CalibrationVector after = calibration.standard_errors();
  EXPECT_LT(after[Calibrated::tdc], 1.3 * before[Calibrated::tdc]);
  EXPECT_LT(after[wall], 1.3 * before[wall]);
  drive(120, 28.0, 35.0);
  EXPECT_NEAR(calibration.parameters()[wall], 0.5, 0.025);
  EXPECT_NEAR(calibration.parameters()[Calibrated::fuel_heat], 0.975, 0.012);
  EXPECT_NEAR(calibration.parameters()[Calibrated::burn_duration], 33.5 / 35.0, 0.012);
  EXPECT_NEAR(calibration.parameters()[Calibrated::soc_offset], 0.2, 0.06);
  EXPECT_NEAR(calibration.parameters()[Calibrated::tdc], 0.4, 0.06);
}

TEST(OnlineCalibration, AtABoundTheOthersStandAsIfItWereKnown) {
  loop::BenchSettings s = steady_bench();
  s.cylinder.wall_heat.wall_heat_scale = 0.12;
  loop::VirtualEngine bench(s);
  OnlineCalibrationSettings free = wrong_guide(CalibrationMethod::gauss_newton, 0.2), fixed = free;
  free.wanted[Calibrated::tdc] = fixed.wanted[Calibrated::tdc] = true;
  fixed.wanted[wall] = false;
  fixed.uncertainty[wall] = 0.0;
  OnlineCalibration at_bound(free), known(fixed);
  for (int k = 0; k < 80; ++k) {
    bench.step(-6.0);
    for (OnlineCalibration* each : {&at_bound, &known}) {
      each->offer(bench.pressure().pressure_bar, {}, -6.0);
      each->update();
    }
  }
  EXPECT_EQ(at_bound.verdict(wall).knowledge, Knowledge::at_bound);
  for (int i = 0; i < n_calibrated; ++i)
    EXPECT_NEAR(at_bound.parameters()[i], known.parameters()[i], 0.02 * info_of(i).known_sd) << info_of(i).field.name;
}

TEST(OnlineCalibration, AMotoredCycleHoldsWhatItDoesNotShow) {
  loop::BenchSettings s = steady_bench(0.1);
  s.misfire_probability = 1.0;  // the motored cycle
  loop::VirtualEngine bench(s);
  OnlineCalibrationSettings g = wrong_guide(CalibrationMethod::gauss_newton);
  g.wanted[Calibrated::burn_duration] = true;
  OnlineCalibration calibration(g);
  engine::OperatingPoint motored;
  motored.fuel_mg = 0.0;
  for (int k = 0; k < 30; ++k) {
    bench.step(-6.0);
    calibration.offer(bench.pressure().pressure_bar, motored, -6.0);
    calibration.update();
  }
  EXPECT_EQ(calibration.parameters()[Calibrated::burn_duration], 1.0);
  EXPECT_EQ(calibration.verdict(Calibrated::burn_duration).knowledge, Knowledge::held);
  EXPECT_NE(calibration.explain(Calibrated::burn_duration).find("held"), std::string::npos);
}

}  // namespace
}  // namespace mgdd::guide
