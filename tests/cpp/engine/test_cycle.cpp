// The cycle, and its derivatives.
#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/gas.hpp"
#include "mgdd/engine/sensitivity.hpp"
#include "support/engine_case.hpp"
#include "support/test.hpp"

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

// Away from kinks: SOC, the joint of the triangle and the end of each burn lie between grid angles.
EngineCase smooth() {
  return EngineCase("soc_cad=-6.37 burn_duration_cad=33.3 trapped_mass_g=0.78 second_duration_cad=50.3");
}

// All differences of one input: the central quotient at h and h/2, extrapolated to h^4.
struct Differences {
  std::vector<double> indicators, pressure_bar;
};

Differences differences(const EngineCase& c, std::string_view name) {
  const auto at = [&](double offset) {
    CycleInputs<double> inputs{c.cylinder, c.point, c.soc_cad};
    input(inputs, name) += offset;
    EngineCase moved = c;
    moved.cylinder = inputs.cylinder;
    moved.point = inputs.point;
    moved.soc_cad = inputs.soc_cad;
    const Cycle cycle = run(moved);
    std::vector<double> all = cycle.pressures_bar();
    for (const auto& field : indicator_fields<double>()) {
      all.push_back(cycle.indicators.*(field.member));
    }
    return all;
  };
  CycleInputs<double> inputs{c.cylinder, c.point, c.soc_cad};
  const double x = std::abs(input(inputs, name));
  const double h = 1e-4 * (x > 0.0 ? x : 1.0);
  const std::vector<double> a = at(h), b = at(-h), d = at(0.5 * h), e = at(-0.5 * h);
  std::vector<double> slope(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    slope[i] = (4.0 * (d[i] - e[i]) / h - (a[i] - b[i]) / (2.0 * h)) / 3.0;
  }
  const auto n = static_cast<std::ptrdiff_t>(a.size() - indicator_fields<double>().size());
  return {{slope.begin() + n, slope.end()}, {slope.begin(), slope.begin() + n}};
}

void compare(const EngineCase& c, const std::string& what) {
  const std::vector<std::string> names = differentiable_inputs();
  const Sensitivities s = sensitivities(c.cylinder, c.point, c.soc_cad, names, c.step_cad, c.integrator);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Differences d = differences(c, names[i]);
    CycleInputs<double> inputs{c.cylinder, c.point, c.soc_cad};
    const double x = std::abs(input(inputs, names[i]));
    const double per = 1.0 / (x > 0.0 ? x : 1.0);
    std::size_t k = 0;
    for (const auto& field : indicator_fields<double>()) {
      const double exact = s.indicators[i].*(field.member);
      const double scale = std::max({std::abs(exact), std::abs(s.value.*(field.member)) * per, 1e-3 * per});
      EXPECT_NEAR(exact, d.indicators[k++], 2e-6 * scale) << what << ": d " << field.name << " / d " << names[i];
    }
    const auto column = s.pressure_bar.col(static_cast<Eigen::Index>(i));
    const double scale = std::max(column.cwiseAbs().maxCoeff(), s.value.p_max_bar * per);
    for (std::size_t row = 0; row < d.pressure_bar.size(); ++row) {
      EXPECT_NEAR(column[static_cast<Eigen::Index>(row)], d.pressure_bar[row], 2e-6 * scale) << what << names[i];
    }
  }
}

TEST(EngineSensitivity, AgreesWithDifferencesForEveryIntegrator) {
  for (const auto integrator : {Integrator::split, Integrator::tan2018_lagged, Integrator::euler}) {
    EngineCase c = smooth();
    c.integrator = integrator;
    c.step_cad = 0.7;
    compare(c, std::string(name_of(integrator)));
  }
}

// Naming an optional of the point holds it constant for all inputs, also for those of another pass.
TEST(EngineSensitivity, NamesAreIndependentOfTheirCompany) {
  const EngineCase c;
  EngineCase fixed = c;
  fixed.point.burn_duration_cad = 30.0;
  fixed.point.trapped_mass_g = run(c).charge.gas_j_per_k / units::gas_constant_j_per_molk * 28.9647;
  const std::vector<std::string> names = differentiable_inputs();
  const Sensitivities all = sensitivities(c.cylinder, c.point, -6.3, names);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Sensitivities one = sensitivities(fixed.cylinder, fixed.point, -6.3, {names[i]});
    EXPECT_NEAR(one.indicators[0].imep_gross_bar, all.indicators[i].imep_gross_bar,
                1e-9 * (1.0 + std::abs(all.indicators[i].imep_gross_bar)))
        << names[i];
  }
}

}  // namespace
}  // namespace mgdd::engine
