// Wall heat: signs and limits; tests/python/engine/test_engine_facts.py has the printed formulas.
#include "mgdd/engine/wall_heat.hpp"

#include <gtest/gtest.h>

#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;

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
