// Laws of one cycle: conservation, closed forms, symmetry, monotony. Numbers stand in test_golden.cpp.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/gas.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;
using test_support::run;

constexpr Integrator integrators[] = {Integrator::trapezoid, Integrator::split, Integrator::tan2018_lagged,
                                      Integrator::euler};
constexpr BurnShape shapes[] = {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe};
constexpr GammaModel gammas[] = {GammaModel::constant, GammaModel::linear, GammaModel::polynomial};
constexpr WallHeatModel walls[] = {WallHeatModel::woschni, WallHeatModel::hohenberg, WallHeatModel::eichelberg};

double sum(const std::vector<double>& column) {
  double total = 0.0;
  for (const double x : column) {
    total += x;
  }
  return total;
}

double booked(const Cycle& c) {
  double total = 0.0;
  for (std::size_t k = 0; k + 1 < c.work.pressure_pa.size(); ++k) {
    total += c.model.booked_work_j(k, c.work);
  }
  return total;
}

TEST(EngineCycle, ReleasesTheFuelEnergyForAnyStartAndDuration) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> start(-25.0, 10.0), duration(1.5, 90.0);
  EngineCase c;
  for (const BurnShape shape : shapes) {
    c.cylinder.burn.burn_shape = shape;
    for (int i = 0; i < 200; ++i) {
      c.soc_cad = start(random);
      c.point.burn_duration_cad = duration(random);
      EXPECT_NEAR(sum(run(c).work.heat_release_j) / 856.0, 1.0, 1e-9) << c.soc_cad;
    }
  }
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

TEST(EngineCycle, ObeysTheFirstLawInEveryVariant) {
  EngineCase c;
  for (const Integrator integrator : integrators) {
    for (const GammaModel gamma : gammas) {
      for (const WallHeatModel wall : walls) {
        for (const BurnShape shape : shapes) {
          c.integrator = integrator;
          c.cylinder.gas.gamma_model = gamma;
          c.cylinder.wall_heat.wall_heat_model = wall;
          c.cylinder.burn.burn_shape = shape;
          const Cycle cycle = run(c);
          double worst = 0.0;
          for (std::size_t k = 0; k + 1 < cycle.work.pressure_pa.size(); ++k) {
            const double heat = cycle.work.heat_release_j[k] - cycle.work.heat_loss_j[k];
            const double spent = cycle.model.booked_work_j(k, cycle.work) + cycle.model.energy_change_j(k, cycle.work);
            worst = std::max(worst, std::abs(heat - spent));
          }
          EXPECT_LT(worst, 1e-9 * 856.0) << name_of(integrator) << " " << name_of(gamma);
        }
      }
    }
  }
}

// Booked work by the definition of each scheme, internal energy by its definition: neither is asked of the model.
TEST(EngineCycle, EnergyBalanceClosesWithHandBookedWork) {
  EngineCase c;
  for (const Integrator integrator : {Integrator::trapezoid, Integrator::tan2018_lagged, Integrator::euler}) {
    c.integrator = integrator;
    const Cycle cycle = run(c);
    const std::vector<double>& p = cycle.work.pressure_pa;
    const auto volume = [&](double angle) { return cycle.model.geometry().volume_m3(angle); };
    double work = 0.0;
    for (std::size_t k = 0; k + 1 < p.size(); ++k) {
      const double at = -140.0 + static_cast<double>(k);
      if (integrator == Integrator::trapezoid) work += 0.5 * (p[k] + p[k + 1]) * (volume(at + 1) - volume(at));
      if (integrator == Integrator::euler) work += p[k] * (volume(at + 1) - volume(at));
      if (integrator == Integrator::tan2018_lagged) work += p[k] * (volume(at) - volume(at - 1));
    }
    const double energy = (p.back() * volume(130.0) - p.front() * volume(-140.0)) / 0.37;
    EXPECT_NEAR(sum(cycle.work.heat_release_j) - sum(cycle.work.heat_loss_j) - work - energy, 0.0, 1e-9 * 856.0);
    EXPECT_NEAR(work, booked(cycle), 1e-9);
  }
}

TEST(EngineCycle, AdiabaticMotoredCompressionIsTheClosedForm) {
  EngineCase c("fuel_mg=0 wall_heat_scale=0");
  const Geometry<double> g(c.cylinder.geometry);
  const double top_bar = 1.5 * std::pow(g.volume_m3(-140.0) / g.volume_m3(0.0), 1.37);
  EXPECT_NEAR(top_bar, 70.904, 5e-4);
  EXPECT_NEAR(run(c).pressure_bar(0.0), top_bar, 5e-4 * top_bar);
  const double end_pa = 1.5e5 * std::pow(g.volume_m3(-140.0) / g.volume_m3(130.0), 1.37);
  const double work = (end_pa * g.volume_m3(130.0) - 1.5e5 * g.volume_m3(-140.0)) / (1.0 - 1.37);
  EXPECT_NEAR(work, -3.832, 5e-4);
  EXPECT_NEAR(run(c).indicators.work_closed_j, work, 0.01);
  c.integrator = Integrator::split;
  for (const double angle : {-90.0, -20.0, 0.0, 40.0, 130.0}) {
    const double exact = 1.5 * std::pow(g.volume_m3(-140.0) / g.volume_m3(angle), 1.37);
    EXPECT_NEAR(run(c).pressure_bar(angle), exact, 1e-11 * exact);
  }
}

TEST(EngineCycle, TrapezoidBooksTheAreaOfTheDiagramAndSeedDoesNot) {
  EngineCase c;
  const Cycle cycle = run(c);
  EXPECT_NEAR(booked(cycle), cycle.indicators.work_closed_j, 1e-12 * 856.0);
  c.integrator = Integrator::tan2018_lagged;
  const auto gap = [&](double soc) {
    c.soc_cad = soc;
    const Cycle seed = run(c);
    return seed.indicators.work_closed_j - booked(seed);
  };
  EXPECT_NEAR(gap(-6.0), 22.3, 0.2);
  for (double soc = -20.0; soc <= 10.0; soc += 5.0) {
    EXPECT_GT(gap(soc), 18.0);
    EXPECT_LT(gap(soc), 28.05);
  }
}

TEST(EngineCycle, EfficiencyStaysBelowTheOttoLimit) {
  const double otto = 1.0 - std::pow(18.2, -0.37);
  EXPECT_NEAR(otto, 0.6582, 5e-5);
  EXPECT_NEAR(run(EngineCase("wall_heat_scale=0 burn_duration_cad=10 soc_cad=-5")).indicators.efficiency_gross, 0.6495,
              0.001);
  for (const char* duration : {"2", "10", "30", "60"}) {
    EngineCase c("wall_heat_scale=0 burn_duration_cad=" + std::string(duration));
    for (c.soc_cad = -30.0; c.soc_cad <= 10.0; c.soc_cad += 2.5) {
      EXPECT_LT(run(c).indicators.efficiency_gross, otto);
    }
  }
}

TEST(EngineCycle, AdvanceRaisesPeaks) {
  EngineCase c("soc_cad=0");
  Indicators<double> late = run(c).indicators;
  const double motored_slope = run(EngineCase("fuel_mg=0")).indicators.dp_max_bar_per_cad;
  EXPECT_NEAR(motored_slope, 2.287, 5e-4);
  for (c.soc_cad = -0.5; c.soc_cad >= -20.0; c.soc_cad -= 0.5) {
    const Indicators<double> now = run(c).indicators;
    EXPECT_GT(now.p_max_bar, late.p_max_bar);
    EXPECT_GT(now.t_max_k, late.t_max_k);
    EXPECT_GE(now.dp_max_bar_per_cad, late.dp_max_bar_per_cad);
    if (c.soc_cad >= -4.0) {
      EXPECT_NEAR(now.dp_max_bar_per_cad, motored_slope, 1e-9);
    } else if (c.soc_cad < -4.5) {
      EXPECT_GT(now.dp_max_bar_per_cad, late.dp_max_bar_per_cad);
    }
    late = now;
  }
}

TEST(EngineCycle, ScalesWithChargeWhenAdiabatic) {
  const EngineCase one("wall_heat_scale=0");
  const EngineCase two("wall_heat_scale=0 intake_pressure_kpa=300 fuel_mg=40 burn_duration_cad=30");
  const Cycle a = run(one), b = run(two);
  for (std::size_t k = 0; k < a.work.pressure_pa.size(); ++k) {
    EXPECT_NEAR(b.work.pressure_pa[k] / a.work.pressure_pa[k], 2.0, 1e-12);
  }
  EXPECT_NEAR(a.indicators.t_max_k, b.indicators.t_max_k, 1e-9);
}

TEST(EngineCycle, GrossWorkIsClosedWorkPlusTheIdealRemainder) {
  const Cycle c = run(EngineCase("ivc_pressure_rise_kpa=7"));
  const Geometry<double>& g = c.model.geometry();
  const double bottom = g.volume_m3(180.0);
  const double rest = 1.5e5 * (g.volume_m3(-140.0) - bottom) +
                      0.5 * (c.work.pressure_pa.back() + 1.5e5) * (bottom - g.volume_m3(130.0));
  EXPECT_NEAR(c.pressure_bar(-140.0), 1.57, 1e-12);
  EXPECT_NEAR(c.indicators.work_gross_j - c.indicators.work_closed_j, rest, 1e-9);
  EXPECT_NEAR(c.indicators.imep_gross_bar * 1e5 * g.swept_m3, c.indicators.work_gross_j, 1e-9);
  EXPECT_NEAR(c.indicators.efficiency_gross * 856.0, c.indicators.work_gross_j, 1e-9);
}

TEST(EngineCycle, TrappedMassIsTheSameChargeSaidOtherwise) {
  const double mass_g = 0.9 * 150.0 * 0.499556936 / (units::gas_constant_j_per_molk * 313.0) * 28.9647;
  const EngineCase with_mass("trapped_mass_g=" + std::to_string(mass_g));
  EXPECT_NEAR(run(with_mass).indicators.t_max_k, run(EngineCase()).indicators.t_max_k, 0.01);
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
