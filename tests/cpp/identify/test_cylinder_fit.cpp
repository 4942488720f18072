// Calibration: recovers what made the data, names what the data do not identify, and meets the reference fits of the
// measured traces. tests/python/identify/test_identify_cylinder.py reads the same reference rows.
#include "mgdd/identify/engine/cylinder_fit.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/engine_case.hpp"

namespace mgdd::identify {
namespace {

using test_support::EngineCase;

const std::vector<std::string> burn_names{"soc_cad", "burn_duration_cad", "fuel_heat_j"};

std::vector<std::string> with(std::vector<std::string> names, std::initializer_list<const char*> more) {
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

std::vector<LoadBurn> estimates(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& c) {
  std::vector<LoadBurn> burns;
  burns.reserve(traces.size());
  for (const MeasuredCycle& t : traces) {
    burns.push_back(estimate_burn(t, c));
  }
  return burns;
}

CylinderFit fit(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& c,
                const std::vector<std::string>& free) {
  return fit_cylinder(traces, c, estimates(traces, c), free, {});
}

// A plant that is the model: two loads of the default cylinder, on the model's own 0.25 CAD grid.
struct Plant {
  EngineCase truth{"step_cad=0.25 wall_heat_scale=0.8 burn_shape=wiebe burn_duration_cad=42"};
  std::vector<MeasuredCycle> traces;

  explicit Plant(double noise_bar = 0.0, std::uint64_t seed = 0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0.0, noise_bar > 0.0 ? noise_bar : 1.0);
    for (const auto& [fuel, soc] : {std::pair{14.0, -5.0}, std::pair{24.0, -9.0}}) {
      truth.point.fuel_mg = fuel;
      truth.soc_cad = soc;
      MeasuredCycle t{"at " + std::to_string(static_cast<int>(fuel)), {}, {}, truth.point};
      const auto cycle = run(truth);
      t.point.trapped_mass_g = engine::mass_of_gas_g(cycle.charge.gas_j_per_k);
      t.angle_cad = cycle.angles();
      t.pressure_bar = cycle.pressures_bar();
      // p(IVC) fixes the charge and is not a residual: noise there is another experiment.
      for (std::size_t k = 1; k < t.pressure_bar.size() && noise_bar > 0.0; ++k)
        t.pressure_bar[k] += noise(random);
      traces.push_back(t);
    }
  }
  engine::Cylinder start() const {
    engine::Cylinder c = truth.cylinder;
    c.wall_heat.wall_heat_scale = 0.3;
    return c;
  }
};

TEST(IdentifyFit, WallHeatTradesWithFuelHeat) {
  const auto f = fit(test_support::hd_traces(), test_support::hd_cylinder(), with(burn_names, {"wall_heat_scale"}));
  EXPECT_TRUE(std::isnan(f.report.correlation(0, 3)));  // held at its bound
  for (Eigen::Index load = 0; load < 4; ++load) {
    const double correlation = f.correlation_if_free(0, 1 + 3 * load + 2);
    EXPECT_GT(correlation, 0.72);
    EXPECT_LT(correlation, 0.935);
  }
}

TEST(IdentifyFit, ABoundNarrowsTheSearchOfOneTraceOrOfAll) {
  const Plant plant;
  const auto start = estimates(plant.traces, plant.start());
  const auto free = with(burn_names, {"wall_heat_scale"});
  CylinderFitOptions options;
  options.bounds = {{"soc_cad[at 24]", -8.0, 20.0}};  // the truth is -9; the other load stays free
  const CylinderFit one = fit_cylinder(plant.traces, plant.start(), start, free, options);
  EXPECT_EQ(one.loads[1].burn.soc_cad, -8.0);
  EXPECT_LT(one.loads[0].burn.soc_cad, -4.0);
  options.bounds = {{"burn_duration_cad", 10.0, 41.0}, {"wall_heat_scale", 0.9, 1.5}};
  const CylinderFit all = fit_cylinder(plant.traces, plant.start(), start, free, options);
  for (const LoadFit& load : all.loads)
    EXPECT_LE(load.burn.burn_duration_cad, 41.0);
  EXPECT_GE(all.cylinder.wall_heat.wall_heat_scale, 0.9);
  options.bounds = {{"burn_duration_cad", 30.0, 60.0}};  // where nothing holds, nothing changes
  const CylinderFit wide = fit_cylinder(plant.traces, plant.start(), start, free, options);
  EXPECT_NEAR(wide.cylinder.wall_heat.wall_heat_scale, 0.8, 1e-6);
  for (const SearchBound& bad : {SearchBound{"wiebe_m", 0.0, 1.0}, SearchBound{"soc_cad[at 99]", 0.0, 1.0},
                                 SearchBound{"soc_cad", 5.0, 5.0}, SearchBound{"burn_duration_cad", 200.0, 300.0}}) {
    options.bounds = {bad};
    EXPECT_THROW(fit_cylinder(plant.traces, plant.start(), start, free, options), ParameterError) << bad.name;
  }
}

TEST(IdentifyFit, ParameterListsAreDisjoint) {
  for (const std::string& name : common_parameters()) {
    const auto loads = load_parameters();
    EXPECT_EQ(std::find(loads.begin(), loads.end(), name), loads.end()) << name;
  }
  LoadBurn burn;
  burn.second_wiebe_m = 1.9;
  EXPECT_EQ(with_burn(engine::Cylinder{}, burn).burn.second_wiebe_m, 1.9);
}

}  // namespace
}  // namespace mgdd::identify
