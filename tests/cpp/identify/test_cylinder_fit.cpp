// Calibration: recovers what made the data, names what the data do not identify, and meets the reference fits of the
// measured traces. tests/python/identify/test_identify_cylinder.py reads the same reference rows.
#include "mgdd/identify/engine/cylinder_fit.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/engine_case.hpp"

namespace mgdd::identify {
namespace {

using engine::BurnShape;
using engine::GammaModel;
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

bool names(const optimize::FitReport& report, const std::string& name) {
  const auto& all = report.unidentifiable;
  return std::find(all.begin(), all.end(), name) != all.end();
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

TEST(IdentifyFit, RecoversTheTruthWithoutNoise) {
  const Plant plant;
  const CylinderFit f = fit(plant.traces, plant.start(), with(burn_names, {"wall_heat_scale"}));
  EXPECT_TRUE(f.report.success());
  EXPECT_NEAR(f.cylinder.wall_heat.wall_heat_scale, 0.8, 0.8e-6);
  EXPECT_NEAR(f.loads[0].burn.soc_cad, -5.0, 5e-6);
  EXPECT_NEAR(f.loads[1].burn.soc_cad, -9.0, 9e-6);
  EXPECT_NEAR(f.loads[0].burn.burn_duration_cad, 42.0, 42e-6);
  EXPECT_NEAR(f.loads[1].burn.fuel_heat_j, 24.0 * 42.8, 24.0 * 42.8e-6);
  for (const LoadFit& load : f.loads) {
    EXPECT_LT(load.rmse_percent, 1e-5);
    EXPECT_LT(std::abs(load.imep_closed_error_percent), 1e-4);
  }
}

TEST(IdentifyFit, StandardErrorsCoverTheTruthUnderNoise) {
  int inside = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Plant plant(0.1, seed);
    const CylinderFit f = fit(plant.traces, plant.start(), with(burn_names, {"wall_heat_scale"}));
    ASSERT_TRUE(f.report.success());
    const double truth[] = {0.8, -5.0, 42.0, 14.0 * 42.8, -9.0, 42.0, 24.0 * 42.8};
    for (Eigen::Index i = 0; i < 7; ++i) {
      const double z = (f.report.values[i] - truth[i]) / f.report.standard_error[i];
      EXPECT_LT(std::abs(z), 4.0) << f.report.names[static_cast<std::size_t>(i)];
      inside += std::abs(z) < 3.0;
      ++all;
    }
  }
  EXPECT_GE(inside, all - 1);
}

TEST(IdentifyFit, WallHeatIsIdentifiableWithKnownFuel) {
  const Plant plant(0.1, 3);
  const std::vector<std::string> free{"wall_heat_scale", "soc_cad", "burn_duration_cad"};
  std::vector<LoadBurn> start = estimates(plant.traces, plant.start());
  start[0].fuel_heat_j = 14.0 * 42.8;
  start[1].fuel_heat_j = 24.0 * 42.8;
  const CylinderFit f = fit_cylinder(plant.traces, plant.start(), start, free, {});
  EXPECT_TRUE(f.report.unidentifiable.empty());
  EXPECT_NEAR(f.cylinder.wall_heat.wall_heat_scale, 0.8, 4.0 * f.report.standard_error[0]);
  EXPECT_LT(f.report.standard_error[0], 0.02 * 0.8);
  const CylinderFit blind = fit(plant.traces, plant.start(), with(free, {"fuel_heat_j"}));
  EXPECT_GT(blind.report.standard_error[0], 1.5 * f.report.standard_error[0]);
}

// Woschni's film goes with scale (C2 Sp + Cp ...)^0.8: the three factors trade exactly. Cetane acts on nothing here.
TEST(IdentifyFit, ExactlyTradingParametersAreNamed) {
  const Plant plant;
  const CylinderFit f =
      fit(plant.traces, plant.start(), with(burn_names, {"wall_heat_scale", "woschni_c2", "woschni_cp_m_per_sk"}));
  for (const char* name : {"wall_heat_scale", "woschni_c2", "woschni_cp_m_per_sk"}) {
    EXPECT_TRUE(names(f.report, name)) << name;
  }
  EXPECT_FALSE(names(f.report, "soc_cad[at 14]"));
  const CylinderFit idle = fit(plant.traces, plant.start(), with(burn_names, {"cetane_number"}));
  EXPECT_EQ(idle.report.unidentifiable, std::vector<std::string>{"cetane_number"});
  EXPECT_TRUE(std::isinf(idle.report.standard_error[0]));
}

TEST(IdentifyFit, MeasuredTracesMeetTheReferenceFits) {
  std::map<std::string, CylinderFit> fits;
  int rows = 0;
  for (const test_support::GoldenRow& row : test_support::read_golden()) {
    if (!row.quantity.starts_with("fit_")) continue;
    if (!fits.contains(row.settings)) {
      const EngineCase c(row.settings);
      engine::Cylinder cylinder = test_support::hd_cylinder();
      cylinder.burn.burn_shape = c.cylinder.burn.burn_shape;
      cylinder.gas.gamma_model = c.cylinder.gas.gamma_model;
      std::vector<std::string> free = with(burn_names, {"wall_heat_scale"});
      if (c.words.contains("free")) free.push_back(c.words.at("free"));
      fits[row.settings] = fit(test_support::hd_traces(c.words.at("traces") == "hd"), cylinder, free);
      EXPECT_TRUE(fits[row.settings].report.success()) << row.settings;
    }
    const auto load = static_cast<std::size_t>(row.at / 25.0) - 1;
    const LoadFit& f = fits[row.settings].loads[load];
    const double value = row.quantity == "fit_rmse_percent" ? f.rmse_percent : f.imep_closed_error_percent;
    EXPECT_NEAR(value, row.value, row.tolerance) << row.settings << " " << row.quantity << " " << row.at;
    ++rows;
  }
  EXPECT_GE(rows, 30);
  EXPECT_EQ(fits["traces=hd burn_shape=wiebe gamma_model=linear"].report.bounds_active[0], -1);
}

TEST(IdentifyFit, DoubleWiebeMeetsItsBarAndMeasuredTracesDoNotTellTheWallHeat) {
  engine::Cylinder c = test_support::hd_cylinder();
  const auto traces = test_support::hd_traces();
  const CylinderFit single = fit(traces, c, with(burn_names, {"wall_heat_scale"}));
  EXPECT_TRUE(names(single.report, "wall_heat_scale"));
  for (const LoadFit& load : single.loads) {
    EXPECT_LE(load.rmse_percent, 1.0);
    EXPECT_LE(std::abs(load.imep_closed_error_percent), 3.0);
  }
  c.burn.burn_shape = BurnShape::double_wiebe;
  c.gas.gamma_model = GammaModel::constant;
  const std::vector<std::string> shape =
      with(burn_names, {"wiebe_m", "second_fraction", "second_delay_cad", "second_duration_cad", "second_wiebe_m"});
  const CylinderFit both = fit(traces, c, with(shape, {"wall_heat_scale"}));
  const double reference[] = {0.17, 0.17, 0.14, 0.27};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LE(both.loads[i].rmse_percent, reference[i]);  // as good as the reference, or better
    EXPECT_LE(std::abs(both.loads[i].imep_closed_error_percent), 1.3);
  }
  // The profile is flat: any scale fits within a few tenths of a percent.
  for (const auto& [scale, percent] : {std::pair{0.0, 0.30}, std::pair{0.5, 0.21}, std::pair{1.0, 0.20}}) {
    c.wall_heat.wall_heat_scale = scale;
    const double rmse = 100.0 * fit(traces, c, shape).report.rmse;
    EXPECT_LE(rmse, percent + 0.005);
    EXPECT_GE(rmse, percent - 0.04);
  }
}

TEST(IdentifyFit, WallHeatTradesWithFuelHeat) {
  const auto f = fit(test_support::hd_traces(), test_support::hd_cylinder(), with(burn_names, {"wall_heat_scale"}));
  EXPECT_TRUE(std::isnan(f.report.correlation(0, 3)));  // held at its bound
  for (Eigen::Index load = 0; load < 4; ++load) {
    const double correlation = f.correlation_if_free(0, 1 + 3 * load + 2);
    EXPECT_GT(correlation, 0.72);
    EXPECT_LT(correlation, 0.935);
  }
}

TEST(IdentifyFit, BadInputIsRefusedByNameAndChangesNothing) {
  const Plant plant;
  const auto start = estimates(plant.traces, plant.start());
  const auto refuses = [&](const std::function<void(std::vector<MeasuredCycle>&, std::vector<LoadBurn>&,
                                                    std::vector<std::string>&, engine::Cylinder&)>& spoil,
                           const std::string& part) {
    auto traces = plant.traces;
    auto burns = start;
    auto free = burn_names;
    auto c = plant.start();
    spoil(traces, burns, free, c);
    try {
      fit_cylinder(traces, c, burns, free, {});
      ADD_FAILURE() << part;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  refuses([](auto&, auto&, auto& free, auto&) { free = {"soc"}; }, "'soc'");
  refuses([](auto&, auto&, auto& free, auto&) { free = {"ivc_cad"}; }, "'ivc_cad'");
  refuses([](auto&, auto&, auto& free, auto&) { free = {"soc_cad", "soc_cad"}; }, "named twice");
  refuses([](auto&, auto&, auto& free, auto&) { free.clear(); }, "free is empty");
  refuses([](auto& t, auto&, auto&, auto&) { t.clear(); }, "traces is empty");
  refuses([](auto&, auto& b, auto&, auto&) { b.pop_back(); }, "start has 1");
  refuses([](auto&, auto& b, auto&, auto&) { b[0].fuel_heat_j = -1.0; }, "fuel_heat_j[at 14]");
  refuses([](auto&, auto& b, auto&, auto&) { b[0].soc_cad = std::nan(""); }, "soc_cad[at 14]");
  refuses([](auto& t, auto&, auto&, auto&) { t[1].pressure_bar[3] = std::nan(""); }, "pressure_bar[3]");
  refuses([](auto& t, auto&, auto&, auto&) { t[1].pressure_bar[3] = -0.2; }, "peg it");
  refuses([](auto& t, auto&, auto&, auto&) { t[0].point.speed_rpm = -1.0; }, "speed_rpm = -1");
  refuses([](auto&, auto&, auto&, auto& c) { c.geometry.bore_mm = -86.0; }, "bore_mm = -86");
  refuses([](auto&, auto&, auto&, auto& c) { c.geometry.ivc_cad = -100.0; }, "cut it to the closed part");
  EXPECT_TRUE(fit(plant.traces, plant.start(), burn_names).report.success());
  CylinderFitOptions options;
  options.step_cad = 0.0;
  EXPECT_THROW(fit_cylinder(plant.traces, plant.start(), start, burn_names, options), ParameterError);
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

TEST(IdentifyFit, AFreedStartPressureUndoesTheErrorOfTheFirstSample) {
  Plant plant;
  std::vector<double> right;
  double factor = 1.04;
  for (MeasuredCycle& t : plant.traces) {
    right.push_back(t.pressure_bar.front());
    t.pressure_bar.front() *= factor;
    factor = 0.97;
  }
  const auto start = estimates(plant.traces, plant.start());
  const auto names = with(burn_names, {"wall_heat_scale", "start_pressure_bar"});
  const CylinderFit found = fit_cylinder(plant.traces, plant.start(), start, names);
  EXPECT_NEAR(found.cylinder.wall_heat.wall_heat_scale, 0.8, 1e-4);  // the wrong sample itself stays a residual
  for (std::size_t i = 0; i < right.size(); ++i)
    EXPECT_NEAR(found.loads[i].burn.start_pressure_bar / right[i], 1.0, 1e-4);
  const CylinderFit held = fit_cylinder(plant.traces, plant.start(), start, with(burn_names, {"wall_heat_scale"}));
  EXPECT_EQ(held.loads[0].burn.start_pressure_bar, plant.traces[0].pressure_bar.front());
  EXPECT_GT(held.report.rmse, 5.0 * found.report.rmse);
}

TEST(IdentifyFit, AMotoredTraceHasNoBurnToEstimate) {
  const auto cycle = run(EngineCase("fuel_mg=0"));
  const MeasuredCycle motored{"motored", cycle.angles(), cycle.pressures_bar(), {}};
  EXPECT_THROW(estimate_burn(motored, engine::Cylinder{}), DataError);
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
