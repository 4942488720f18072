// The step-size bars: the default integrator at 1 CAD against its own answer at 0.01 CAD.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/sensitivity.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::EngineCase;
using test_support::indicator;

struct Errors {
  double imep, p_max, t_max;  // relative
};

Indicators<double> at_step(EngineCase c, double step) {
  c.step_cad = step;
  return run(c).indicators;
}

Errors errors(const EngineCase& c, double step) {
  const Indicators<double> fine = at_step(c, 0.01), coarse = at_step(c, step);
  return {coarse.imep_closed_bar / fine.imep_closed_bar - 1.0, coarse.p_max_bar / fine.p_max_bar - 1.0,
          coarse.t_max_k / fine.t_max_k - 1.0};
}

TEST(EngineStepSize, DefaultPointWithinItsBars) {
  const Errors e = errors(EngineCase(), 1.0);
  EXPECT_LT(std::abs(e.imep), 0.05e-2);
  EXPECT_LT(std::abs(e.p_max), 0.2e-2);
  EXPECT_LT(std::abs(e.t_max), 0.15e-2);
}

TEST(EngineStepSize, MapWithinItsBars) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 40; ++i) {
    EngineCase c;
    // The first eight are the corners of the map.
    const auto pick = [&](int bit) { return i < 8 ? static_cast<double>((i >> bit) & 1) : unit(random); };
    c.point.speed_rpm = 900.0 + 2100.0 * pick(0);
    c.point.fuel_mg = 6.0 + 34.0 * pick(1);
    c.soc_cad = -20.0 + 25.0 * pick(2);
    const Errors e = errors(c, 1.0);
    EXPECT_LT(std::abs(e.imep), 0.3e-2) << c.point.speed_rpm << " " << c.point.fuel_mg << " " << c.soc_cad;
    EXPECT_LT(std::abs(e.p_max), 0.6e-2) << c.point.speed_rpm << " " << c.point.fuel_mg << " " << c.soc_cad;
    EXPECT_LT(std::abs(e.t_max), 0.5e-2) << c.point.speed_rpm << " " << c.point.fuel_mg << " " << c.soc_cad;
  }
}

TEST(EngineStepSize, ErrorHalvesWithTheStep) {
  const EngineCase c;
  const Errors one = errors(c, 1.0), half = errors(c, 0.5);
  EXPECT_NEAR(half.imep / one.imep, 0.5, 0.06);
  EXPECT_NEAR(half.p_max / one.p_max, 0.5, 0.06);
  EXPECT_NEAR(half.t_max / one.t_max, 0.5, 0.06);
}

TEST(EngineStepSize, GridChangesEfficiencyLittleUnlessTheSchemeIsFirstOrder) {
  const auto change = [](Integrator integrator) {
    EngineCase c;
    c.integrator = integrator;
    return at_step(c, 1.0).efficiency_gross - at_step(c, 0.1).efficiency_gross;
  };
  EXPECT_LT(std::abs(change(Integrator::trapezoid)), 2e-4);
  EXPECT_LT(std::abs(change(Integrator::split)), 2e-4);
  EXPECT_NEAR(change(Integrator::tan2018_lagged), 1.5e-2, 0.05e-2);
  EXPECT_NEAR(change(Integrator::euler), -7.9e-3, 0.1e-3);
}

TEST(EngineStepSize, EstimateAgreesWithTheTrueError) {
  const EngineCase c;
  const Indicators<double> coarse = at_step(c, 1.0), fine = at_step(c, 0.01);
  int compared = 0;
  for (const ConvergenceEstimate& e : convergence(c.cylinder, c.point, c.soc_cad)) {
    EXPECT_DOUBLE_EQ(e.value, indicator(coarse, e.name));
    EXPECT_DOUBLE_EQ(e.value - e.extrapolated, e.error);
    if (e.name == "imep_closed_bar" || e.name == "t_max_k" || e.name == "heat_loss_j" || e.name == "p_max_bar") {
      const double error = indicator(coarse, e.name) - indicator(fine, e.name);
      EXPECT_NEAR(e.error, error, 0.2 * std::abs(error)) << e.name;
      EXPECT_NEAR(e.order, 1.0, 0.3) << e.name;
      ++compared;
    }
  }
  EXPECT_EQ(compared, 4);
  EXPECT_THROW(convergence(c.cylinder, c.point, c.soc_cad, 0.003), ParameterError);
  EXPECT_THROW(convergence(c.cylinder, c.point, 90.0), ParameterError);
  Cylinder bad = c.cylinder;
  bad.geometry.bore_mm = -86.0;
  EXPECT_THROW(convergence(bad, c.point, c.soc_cad), ParameterError);
}

}  // namespace
}  // namespace mgdd::engine
