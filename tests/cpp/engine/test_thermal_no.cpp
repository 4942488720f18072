// Thermal NO: rates against NO and N integrated by themselves (Cantera's constants), a cycle's books, and what acts
// how.
#include "mgdd/engine/thermal_no.hpp"

#include <gtest/gtest.h>

#include "mgdd/engine/cycle_trace.hpp"

namespace mgdd::engine {
namespace {

double held(double lambda, double t, double p, double seconds, double start = 0.0, int steps = 400) {
  const BurnedGas gas = burned_gas({.lambda = lambda}, t, p);
  double no = start;
  for (int k = 0; k < steps; ++k)
    no = no_after(no, gas, t, p, seconds / steps, NoRates::hanson_salimian);
  return no;
}

// CH1.86, backward rates by detailed balance: 6 % off the tabulated one.
TEST(EngineThermalNo, ApproachesEquilibriumAsBothEquationsDo) {
  struct Row {
    double lambda, t, p, seconds, start, no;
  };
  for (const Row& r : {Row{1.1, 2600.0, 8e6, 1e-4, 0.0, 0.0012106}, Row{1.1, 2600.0, 8e6, 1e-3, 0.0, 0.0063441},
                       Row{1.1, 2600.0, 8e6, 3e-3, 0.0, 0.0074199}, Row{1.1, 2300.0, 6e6, 1e-3, 0.0, 0.000377},
                       Row{1.1, 2300.0, 6e6, 1e-2, 0.0, 0.0026319}, Row{1.4, 2450.0, 5e6, 5e-4, 0.0, 0.0017829},
                       Row{1.4, 2450.0, 5e6, 5e-3, 0.0, 0.0089851}, Row{1.1, 2300.0, 6e6, 1e-2, 0.009, 0.00592386}})
    EXPECT_NEAR(held(r.lambda, r.t, r.p, r.seconds, r.start) / r.no, 1.0, 0.03) << r.t << " " << r.seconds;
}

TEST(EngineThermalNo, OneLongStepStaysBelowEquilibrium) {
  const BurnedGas gas = burned_gas({.lambda = 1.1}, 2700.0, 8e6);
  const double wide = no_after(0.0, gas, 2700.0, 8e6, 1.0, NoRates::hanson_salimian);
  EXPECT_NEAR(wide, gas[Species::no], 1e-3 * gas[Species::no]);
  EXPECT_LE(wide, gas[Species::no]);
}

ThermalNoCycle of(double soc, const ThermalNo& model = {}, OperatingPoint point = {}, double step = 1.0) {
  const Cylinder cylinder;
  const CycleTrace c = trace_cycle(cylinder, point, soc, step, Integrator::trapezoid);
  return thermal_no(c.angle_cad, c.pressure_bar, c.volume_l, c.temperature_k, c.burned_fraction, cylinder, point,
                    model);
}

TEST(EngineThermalNo, EarlierBurnsMakeMoreAndItFreezes) {
  double last = of(-14.0).nox_ppm;
  for (const double soc : {-10.0, -6.0, -2.0, 2.0}) {
    const ThermalNoCycle c = of(soc);
    EXPECT_LT(c.nox_ppm, last);
    last = c.nox_ppm;
  }
  const ThermalNoCycle c = of(-6.0);
  EXPECT_GT(c.flame_max_k, 2500.0);
  EXPECT_LT(c.flame_max_k, 2900.0);
  EXPECT_GT(c.nox_ppm, 100.0);
  EXPECT_LT(c.nox_ppm, 5000.0);
  const std::size_t n = c.no_ppm.size();
  EXPECT_NEAR(c.no_ppm[n - 30], c.no_ppm[n - 1], 1e-6 * c.no_ppm[n - 1]);
}

TEST(EngineThermalNo, ExhaustGasInTheChargeAndMixingTakeNoAway) {
  const double plain = of(-6.0).nox_ppm;
  EXPECT_LT(of(-6.0, {.intake_o2_fraction = 0.18}).nox_ppm, 0.5 * plain);
  EXPECT_LT(of(-6.0, {.mixing_time_ms = 0.5}).nox_ppm, plain);
  EXPECT_NEAR(of(-6.0, {.calibration = 0.4}).nox_ppm, 0.4 * plain, 1e-9 * plain);
  EXPECT_GT(of(-6.0, {.rates = NoRates::hanson_salimian}).nox_ppm, 1.3 * of(-6.0, {.rates = NoRates::heywood}).nox_ppm);
}

TEST(EngineThermalNo, FinerStepsAgree) {
  const double fine = of(-6.0, {}, {}, 0.125).nox_ppm;
  EXPECT_NEAR(of(-6.0, {}, {}, 0.25).nox_ppm / fine, 1.0, 0.01);
  EXPECT_NEAR(of(-6.0, {}, {}, 1.0).nox_ppm / fine, 1.0, 0.06);
}

// Grams by hand: moles of the exhaust, of NO2, over the work of the loop.
TEST(EngineThermalNo, GramsPerKilowattHour) {
  const Cylinder cylinder;
  const OperatingPoint point;
  const CycleTrace c = trace_cycle(cylinder, point, -6.0, 1.0, Integrator::trapezoid);
  const ThermalNoCycle no =
      thermal_no(c.angle_cad, c.pressure_bar, c.volume_l, c.temperature_k, c.burned_fraction, cylinder, point, {});
  double work = 0.0;
  for (std::size_t k = 1; k < c.angle_cad.size(); ++k)
    work += 50.0 * (c.pressure_bar[k] + c.pressure_bar[k - 1]) * (c.volume_l[k] - c.volume_l[k - 1]);
  const double charge = c.pressure_bar[0] * 100.0 * c.volume_l[0] / (8.314462618 * c.temperature_k[0]);
  const double grams = charge * no.nox_ppm * 1e-6 * 46.0055;
  EXPECT_NEAR(no.nox_g_per_kwh / (grams / (work / 3.6e6)), 1.03, 0.01);  // burning adds moles
  EXPECT_NEAR(no.lambda_global, charge * 0.209 / ((1.0 + 0.25 * 1.86) * 1e-3 * point.fuel_mg / (12.011 + 1.86 * 1.008)),
              1e-9);
}

}  // namespace
}  // namespace mgdd::engine
