// Wall heat: the film coefficients in other unit systems, and the arranged step against the printed formula.
#include "mgdd/engine/wall_heat.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;

TEST(EngineWallHeat, WoschniConstantsOfAllUnitSystemsAgree) {
  const double w = 17.0;
  const double h = woschni_coefficient(woschni_c1_bar_m, 0.086, 80.0, 1700.0, w);
  EXPECT_NEAR(woschni_coefficient(3.26, 0.086, 8000.0, 1700.0, w) / h, 1.0, 5e-4);   // kPa, m
  EXPECT_NEAR(woschni_coefficient(516.8, 86.0, 80.0, 1700.0, w) / h, 1.0, 5e-4);     // bar, mm
  EXPECT_NEAR(woschni_coefficient(0.01298, 0.086, 80e5, 1700.0, w) / h, 1.0, 5e-4);  // Pa, m
  EXPECT_NEAR(3.26 * std::pow(100.0, 0.8), woschni_c1_bar_m, 0.05);
}

// By hand: 2.28 x 8.6 m/s, and 3.24e-3 x 0.9 x 320 K x 1.5 on top while combustion lifts the pressure.
TEST(EngineWallHeat, WoschniVelocityGrowsWithThePressureOfCombustionOnly) {
  EXPECT_DOUBLE_EQ(woschni_velocity(2.28, 3.24e-3, 8.6, 0.9, 320.0, 0.0), 19.608);
  EXPECT_DOUBLE_EQ(woschni_velocity(2.28, 3.24e-3, 8.6, 0.9, 320.0, -0.4), 19.608);
  EXPECT_NEAR(woschni_velocity(2.28, 3.24e-3, 8.6, 0.9, 320.0, 1.5), 19.608 + 1.39968, 1e-12);
}

// The burning term acts from SOC on and never below the motored pressure; a hot wall lifts p above it before SOC.
TEST(EngineWallHeat, StepEqualsThePrintedWoschniFormula) {
  for (const auto& [settings, wall_k] : {std::pair{"", 450.0}, std::pair{"wall_temperature_k=1900 soc_cad=-6", 1900.0},
                                         std::pair{"wall_temperature_k=1900 soc_cad=-6.5", 1900.0}}) {
    const EngineCase c(settings);
    const Cycle cycle = run(c);
    const Geometry<double>& g = cycle.model.geometry();
    const double speed = g.mean_piston_speed_m_per_s(1500.0);
    const double ref_volume = g.volume_m3(-140.0), ref_temperature = cycle.temperature_k(-140.0);
    int clamped = 0, early = 0;
    for (std::size_t k = 0; k + 1 < cycle.work.pressure_pa.size(); ++k) {
      const double angle = cycle.model.angles_cad()[k], volume = g.volume_m3(angle);
      const double bar = cycle.work.pressure_pa[k] / 1e5, temperature = cycle.temperature_k(angle);
      const double rise = bar - 1.5 * std::pow(ref_volume / volume, 1.37);
      clamped += angle >= c.soc_cad && rise < 0.0;
      early += angle < c.soc_cad && rise > 1e-9;
      double w = 2.28 * speed;
      if (angle >= c.soc_cad && rise > 0.0) {
        w += 3.24e-3 * g.swept_m3 * ref_temperature / (1.5 * ref_volume) * rise;
      }
      const double h =
          64.9 * std::pow(0.086, -0.2) * std::pow(bar, 0.8) * std::pow(temperature, -0.55) * std::pow(w, 0.8);
      const double loss = h * g.wall_area_m2(volume) * (temperature - wall_k) / (6.0 * 1500.0);
      EXPECT_NEAR(cycle.work.heat_loss_j[k], loss, 1e-11 + 1e-11 * std::abs(loss)) << settings << " " << angle;
    }
    EXPECT_GT(wall_k == 450.0 ? clamped : early, 0);
  }
}

TEST(EngineWallHeat, StepEqualsThePrintedHohenbergFormula) {
  const Cycle cycle = run(EngineCase("wall_heat_model=hohenberg wall_heat_scale=1"));
  const Geometry<double>& g = cycle.model.geometry();
  for (std::size_t k = 0; k + 1 < cycle.work.pressure_pa.size(); ++k) {
    const double angle = cycle.model.angles_cad()[k], volume = g.volume_m3(angle);
    const double bar = cycle.work.pressure_pa[k] / 1e5, temperature = cycle.temperature_k(angle);
    const double h =
        130.0 * std::pow(volume, -0.06) * std::pow(bar, 0.8) * std::pow(temperature, -0.4) * std::pow(4.3 + 1.4, 0.8);
    EXPECT_NEAR(h / hohenberg_coefficient(130.0, volume, bar, temperature, 4.3), 1.0, 1e-13);
    const double loss = h * g.wall_area_m2(volume) * (temperature - 450.0) / (6.0 * 1500.0);
    EXPECT_NEAR(cycle.work.heat_loss_j[k], loss, 1e-11 + 1e-11 * std::abs(loss));
  }
}

// In MPa as printed; the heat of a step needs no power of the pressure.
TEST(EngineWallHeat, StepEqualsThePrintedEichelbergFormula) {
  const Cycle cycle = run(EngineCase("wall_heat_model=eichelberg wall_heat_scale=1"));
  const Geometry<double>& g = cycle.model.geometry();
  for (std::size_t k = 0; k + 1 < cycle.work.pressure_pa.size(); ++k) {
    const double angle = cycle.model.angles_cad()[k], volume = g.volume_m3(angle);
    const double mega = cycle.work.pressure_pa[k] / 1e6, temperature = cycle.temperature_k(angle);
    const double h = 7.67 * std::cbrt(4.3) * std::sqrt(mega * temperature);
    EXPECT_NEAR(eichelberg_coefficient(2.43, 10.0 * mega, temperature, 4.3) / h, 1.0, 2e-3);
    const double loss = h * g.wall_area_m2(volume) * (temperature - 450.0) / (6.0 * 1500.0);
    EXPECT_NEAR(cycle.work.heat_loss_j[k], loss, 2e-3 * std::abs(loss));
  }
}

TEST(EngineWallHeat, LossOfAGivenTraceIsTheCyclesOwn) {
  for (const char* model : {"wall_heat_model=woschni", "wall_heat_model=hohenberg", "wall_heat_model=eichelberg"}) {
    const Cycle c = run(EngineCase(model));
    std::vector<double> loss(c.work.pressure_pa.size());
    c.model.wall_heat(c.charge, std::span<const double>(c.work.pressure_pa), -6.0, std::span<double>(loss));
    for (std::size_t k = 0; k + 1 < loss.size(); ++k) {
      EXPECT_NEAR(loss[k], c.work.heat_loss_j[k], 1e-12);
    }
  }
}

TEST(EngineWallHeat, NoneWithoutScaleAndInwardFromAHotWall) {
  EXPECT_EQ(run(EngineCase("wall_heat_scale=0")).indicators.heat_loss_j, 0.0);
  const Cycle hot = run(EngineCase("fuel_mg=0 wall_temperature_k=2000"));
  EXPECT_LT(hot.indicators.heat_loss_j, 0.0);
  EXPECT_GT(run(EngineCase("wall_heat_scale=1")).indicators.heat_loss_j, run(EngineCase()).indicators.heat_loss_j);
}

}  // namespace
}  // namespace mgdd::engine
