// Laws of the further inputs of the bench: each is what the cycle model makes of it, and none of it is today's bench.
#include "mgdd/engine/recirculation.hpp"
#include "mgdd/loop/engine_loop.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "mgdd/loop/virtual_engine_lanes.hpp"
#include "support/bench_case.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

using enum BenchInput;
using test_support::bits_of;
using test_support::quiet_bench;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

BenchSettings steering(std::vector<BenchInput> inputs, BenchSettings s = quiet_bench()) {
  s.inputs = std::move(inputs);
  return s;
}

BenchCycle step(VirtualEngine& bench, const std::vector<double>& inputs) {
  return bench.step(inputs);
}

// Exhaust of a cycle mixed into the charge of the next until nothing changes, element by element.
TEST(BenchInputs, OxygenIsThatOfExhaustDrivenRound) {
  const double y = 1.86, o2_g = 31.998, air_g = 28.9647, rest_g = (air_g - 0.209 * o2_g) / 0.791;
  const double co2_g = 12.011 + o2_g, h2o_g = 1.008 * 2.0 + 0.5 * o2_g;
  const double charge_g = 0.75, fuel_mg = 27.0, egr = 0.37;
  const double fuel_mol = 1e-3 * fuel_mg / (12.011 + 1.008 * y);
  double o2 = 0.209, rest = 0.791, co2 = 0.0, h2o = 0.0;  // of a mole of exhaust, air at first
  double x = 0.0;
  for (int k = 0; k < 200; ++k) {
    const double exhaust_mol = egr * charge_g / (o2 * o2_g + rest * rest_g + co2 * co2_g + h2o * h2o_g);
    const double air_mol = (1.0 - egr) * charge_g / air_g;
    const double o2_mol = 0.209 * air_mol + o2 * exhaust_mol, all = air_mol + exhaust_mol;
    x = o2_mol / all;
    const double left = o2_mol - fuel_mol * (1.0 + 0.25 * y), rest_mol = 0.791 * air_mol + rest * exhaust_mol;
    const double co2_mol = co2 * exhaust_mol + fuel_mol, h2o_mol = h2o * exhaust_mol + 0.5 * y * fuel_mol;
    const double out = left + rest_mol + co2_mol + h2o_mol;
    o2 = left / out, rest = rest_mol / out, co2 = co2_mol / out, h2o = h2o_mol / out;
  }
  const engine::Recirculation gas = engine::recirculation(egr, charge_g, fuel_mg);
  EXPECT_NEAR(gas.intake_o2_fraction, x, 2e-6);  // masses of the elements in five digits
  EXPECT_NEAR(gas.lambda, 0.63 * 0.75 / 0.027 / 14.62, 2e-3);
  const engine::Recirculation none = engine::recirculation(0.0, charge_g, fuel_mg);
  EXPECT_EQ(none.intake_o2_fraction, engine::air_o2_fraction);
  EXPECT_EQ(none.gamma_change, 0.0);
  // Where nothing is left, the exhaust is burned through: no EGR rate makes more of it.
  EXPECT_NEAR(engine::recirculation(0.5, 0.3, 27.0).intake_o2_fraction, 0.209 * 0.50048, 1e-5);
}

// cp of the JANAF tables at 1000 K (Chase 1998) [J/(mol K)].
TEST(BenchInputs, GammaFallsAsTheTablesSay) {
  const double cp_n2 = 32.698, cp_o2 = 34.870, cp_co2 = 54.308, cp_h2o = 41.268, r = 8.3145;
  const auto gamma = [r](double cp) { return cp / (cp - r); };
  const double air = 0.209 * cp_o2 + 0.791 * cp_n2;
  const double moles = 0.791 + 0.209 / 1.465 * 1.93;  // that a mole of air becomes, burned through
  const double burned = (0.791 * cp_n2 + 0.209 / 1.465 * (cp_co2 + 0.93 * cp_h2o)) / moles;
  const engine::Recirculation gas = engine::recirculation(0.4, 0.75, 20.0);
  const double share = 1.0 - gas.intake_o2_fraction / 0.209;
  EXPECT_NEAR(gas.gamma_change, gamma((1.0 - share) * air + share * burned) - gamma(air), 1e-4);
  EXPECT_LT(gas.gamma_change, -0.008);

  VirtualEngine bench(steering({soc_cad, egr}));
  step(bench, {-6.0, 0.4});
  const double charge_g = engine::mass_of_gas_g(bench.model().charge(bench.point()).gas_j_per_k);
  EXPECT_DOUBLE_EQ(bench.model().cylinder().gas.gamma, 1.37 + engine::recirculation(0.4, charge_g, 20.0).gamma_change);
}

TEST(BenchInputs, NoxTakesTheOxygenFactorAndTheChargeKeepsItsMass) {
  BenchSettings s = steering({soc_cad, egr});
  s.soft_sensor.model.o2_exponent = 2.2;
  VirtualEngine bench(s);
  const double gas = 0.9 * 150e3 * bench.model().geometry().swept_m3 / 313.0;  // J/K, Tan 2018, eq. 2-3
  for (const double rate : {0.0, 0.15, 0.42}) {
    const BenchCycle c = step(bench, {-7.0, rate});
    const double t = c.indicators.t_max_k, x = c.intake_o2_fraction / 0.209;
    EXPECT_NEAR(c.nox_true_ppm, 1200.0 * std::exp(-16000.0 * (1.0 / t - 1.0 / 1900.0)) * x * x * x, 1e-9);
    EXPECT_NEAR(c.nox_soft_ppm, 1200.0 * std::exp(16000.0 / 1900.0 / 1900.0 * (t - 1900.0)) * std::pow(x, 2.2), 1e-9);
    const PressureTrace trace = bench.pressure();
    EXPECT_NEAR(trace.pressure_bar.front(), 1.5, 1e-12);
    EXPECT_NEAR(c.t_evo_k, trace.pressure_bar.back() * 1e5 * bench.model().volume_m3().back() / gas, 1e-8);
  }
  // Less than proportional: lean exhaust brings oxygen back.
  const double x = step(bench, {-7.0, 0.4}).intake_o2_fraction;
  EXPECT_GT(x, 0.209 * 0.7);
  EXPECT_LT(x, 0.209 * 0.8);
}

TEST(BenchInputs, EachIsTheSameAsInThePointOrTheCylinder) {
  const auto same = [](const BenchSettings& steered, const std::vector<double>& inputs, const BenchSettings& fixed) {
    VirtualEngine one(steered), other(fixed);
    EXPECT_EQ(bits_of(one.step(inputs)), bits_of(other.step(inputs[0])));
  };
  BenchSettings s = quiet_bench();
  s.schedule[0].point.intake_pressure_kpa = 187.0;
  same(steering({soc_cad, intake_pressure_kpa}), {-9.0, 187.0}, s);
  BenchSettings heavy = quiet_bench();
  heavy.schedule[0].point.trapped_mass_g = 0.7;
  s.schedule[0].point.trapped_mass_g = 0.7 * (187.0 / 150.0);
  same(steering({soc_cad, intake_pressure_kpa}, heavy), {-9.0, 187.0}, s);
  s = quiet_bench();
  s.schedule[0].point.burn_duration_cad = 52.5;
  same(steering({soc_cad, burn_duration_cad}), {-9.0, 52.5}, s);
  s = quiet_bench();
  s.cylinder.burn.burn_shape = engine::BurnShape::double_wiebe;
  const BenchSettings split = steering({soc_cad, second_fraction}, s);
  s.cylinder.burn.second_fraction = 0.25;
  same(split, {-9.0, 0.25}, s);
}

TEST(BenchInputs, NoxAndExhaustTemperatureAreLimits) {
  BenchSettings s = steering({soc_cad, egr}, BenchSettings{});
  s.limits = {"nox_soft_ppm", "t_evo_k", "nox_fast_ppm", "dp_max_bar_per_cad", "nox_true_ppm"};
  VirtualEngine bench(s);
  step(bench, {-9.0, 0.1});
  const BenchCycle c = step(bench, {-6.0, 0.3});
  const double expected[] = {c.nox_soft_ppm, c.t_evo_k, c.nox_fast_ppm, c.indicators.dp_max_bar_per_cad,
                             c.nox_true_ppm};
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_EQ(c.limits()[i], expected[i]);
  BenchSettings quiet = steering({soc_cad, egr});
  quiet.limits = s.limits;
  VirtualEngine silent(quiet);
  const BenchCycle truth = step(silent, {-6.0, 0.3});
  const std::vector<double> inputs{-6.0, 0.3};
  const auto free = bench.noise_free_limits(2, inputs);
  EXPECT_EQ(free[0], truth.nox_true_ppm);  // the soft sensor is another map; its limit is of NOx
  EXPECT_EQ(free[1], truth.t_evo_k);
  EXPECT_EQ(free[2], truth.nox_true_ppm);
  EXPECT_EQ(free[3], truth.indicators.dp_max_bar_per_cad);
  EXPECT_TRUE(std::isnan(bench.noise_free_limits(2, nan)[0]));
}

TEST(BenchInputs, WhatFindsNoOxygenDoesNotBurn) {
  VirtualEngine bench(steering({soc_cad, egr, intake_pressure_kpa}));
  const double full = step(bench, {-6.0, 0.5, 110.0}).indicators.work_gross_j;
  const BenchCycle starved = step(bench, {-6.0, 0.5, 60.0});
  const double charge_g = engine::mass_of_gas_g(0.9 * 60e3 * bench.model().geometry().swept_m3 / 313.0);
  const double lambda = engine::recirculation(0.5, charge_g, 20.0).lambda;
  EXPECT_LT(lambda, 0.6);
  EXPECT_LT(starved.indicators.work_gross_j, 0.7 * full);
  EXPECT_DOUBLE_EQ(
      starved.indicators.efficiency_gross,
      starved.indicators.work_gross_j / (20.0 * bench.settings().cylinder.gas.lower_heating_value_mj_per_kg));
}

}  // namespace
}  // namespace mgdd::loop
