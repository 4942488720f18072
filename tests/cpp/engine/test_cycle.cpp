// Edges of one cycle. Its laws and numbers stand in tests/python/engine/test_engine_cycle.py and test_engine_facts.py.
#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/gas.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;
using test_support::run;

constexpr GammaModel gammas[] = {GammaModel::constant, GammaModel::linear, GammaModel::polynomial};

double sum(const std::vector<double>& column) {
  double total = 0.0;
  for (const double x : column) {
    total += x;
  }
  return total;
}

// Only a second law that starts before the first can reach back to IVC; its early heat is lost, not booked at once.
TEST(EngineCycle, HeatBeforeTheGridIsLost) {
  const EngineCase c("burn_shape=double_wiebe ivc_cad=-50 soc_cad=-45 second_delay_cad=-15");
  const Cycle cycle = run(c);
  const Burn<double> burn(c.cylinder.burn, c.soc_cad, 30.0);
  const double lost = burn.fraction(-50.0);
  EXPECT_GT(lost, 0.01);
  EXPECT_NEAR(sum(cycle.work.heat_release_j), 856.0 * (1.0 - lost), 1e-9);
}

// gamma(T) is implicit: three solves per step leave it at the mean temperature of the step to six digits.
TEST(EngineCycle, StepGammaBelongsToTheMeanTemperature) {
  for (const char* law : {"gamma_model=linear", "gamma_model=polynomial"}) {
    const EngineCase c(law);
    const Cycle cycle = run(c);
    for (std::size_t k = 0; k + 1 < cycle.work.pressure_pa.size(); ++k) {
      const double mean = 0.5 * (cycle.temperature_k(cycle.model.angles_cad()[k]) +
                                 cycle.temperature_k(cycle.model.angles_cad()[k + 1]));
      EXPECT_NEAR(cycle.work.gamma[k], gamma_at(c.cylinder.gas, mean), 1e-6) << law;
    }
  }
}

TEST(EngineCycle, MotoredCycleHasNoBurnFigures) {
  const Indicators<double> i = run(EngineCase("fuel_mg=0")).indicators;
  for (const double x : {i.efficiency_gross, i.heat_loss_fraction, i.ca10_cad, i.ca50_cad, i.ca90_cad}) {
    EXPECT_TRUE(std::isnan(x));
  }
}

TEST(EngineCycle, GridShortensItsLastStepAndRefusesOthers) {
  const Cylinder cylinder;
  const std::vector<double> grid = crank_grid(cylinder, 0.7);
  EXPECT_EQ(grid.front(), -140.0);
  EXPECT_EQ(grid.back(), 130.0);
  for (std::size_t k = 1; k < grid.size(); ++k) {
    EXPECT_GT(grid[k] - grid[k - 1], 1e-6);
    EXPECT_LT(grid[k] - grid[k - 1], 0.7 + 1e-9);
  }
  EXPECT_EQ(crank_grid(cylinder, 0.1).size(), 2701u);
  for (const double step : {0.0, -1.0, 0.0009, 5.001, std::nan("")}) {
    EXPECT_THROW(crank_grid(cylinder, step), ParameterError);
  }
  EXPECT_THROW(CycleModel<double>(cylinder, {-140.0, 0.0, 0.0, 130.0}), DataError);
  EXPECT_THROW(CycleModel<double>(cylinder, {-140.0, 130.0}), ShapeError);
}

TEST(EngineCycle, SettingACylinderEqualsBuildingANewModel) {
  const EngineCase start("gamma_model=linear burn_shape=double_wiebe");
  for (const GammaModel gamma : gammas) {
    for (const auto& field : cylinder_fields<double>()) {
      EngineCase c = start;
      c.cylinder.gas.gamma_model = gamma;
      const std::vector<double> grid = crank_grid(c.cylinder);
      CycleModel<double> reused(c.cylinder, grid);
      const double old = field.in(c.cylinder);
      field.in(c.cylinder) = old * 1.03 + (old == 0.0 ? 0.01 : 0.0);
      reused.set_cylinder(c.cylinder);
      const CycleModel<double> fresh(c.cylinder, grid);
      CycleWorkspace<double> a = reused.make_workspace(), b = fresh.make_workspace();
      reused.run(reused.charge(c.point), c.soc_cad, a);
      fresh.run(fresh.charge(c.point), c.soc_cad, b);
      EXPECT_EQ(a.pressure_pa, b.pressure_pa) << field.info.name;
      EXPECT_EQ(a.heat_loss_j, b.heat_loss_j) << field.info.name;
    }
  }
}

}  // namespace
}  // namespace mgdd::engine
