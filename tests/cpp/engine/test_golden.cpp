// The reference numbers of tests/data/engine_golden.csv; tests/python/engine/test_engine_cycle.py reads the same file.
#include <cmath>
#include <limits>
#include <map>

#include <gtest/gtest.h>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/emissions.hpp"
#include "mgdd/engine/ignition.hpp"
#include "mgdd/engine/pressure/pegging.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;
using test_support::GoldenRow;
using test_support::indicator;

double optimum(const EngineCase& given, const std::string& wanted) {
  EngineCase c = given;
  const auto named = c.words.find("objective");
  const std::string objective = named == c.words.end() ? "efficiency_gross" : named->second;
  c.soc_cad = best_soc_cad(c, objective);
  if (wanted == "soc_cad") return c.soc_cad;
  if (wanted != "curvature_per_cad2") return indicator(run(c).indicators, wanted);
  const auto around = [&](double offset) {
    EngineCase moved = c;
    moved.soc_cad += offset;
    return indicator(run(moved).indicators, objective);
  };
  return (around(-3.0) - 2.0 * around(0.0) + around(3.0)) / 9.0;
}

double geometry(const EngineCase& c, const GoldenRow& row) {
  const Geometry<double> g(c.cylinder.geometry);
  if (row.quantity == "swept_volume_l") return g.swept_m3 / units::m3_per_l;
  if (row.quantity == "clearance_volume_l") return g.clearance_m3 / units::m3_per_l;
  if (row.quantity == "volume_l") return g.volume_m3(row.at) / units::m3_per_l;
  if (row.quantity == "wall_area_mm2") return g.wall_area_m2(g.volume_m3(row.at)) * 1e6;
  return std::numeric_limits<double>::quiet_NaN();
}

double simulated(const EngineCase& c, const GoldenRow& row) {
  const Cycle cycle = run(c);
  const double amount_mol = cycle.charge.gas_j_per_k / units::gas_constant_j_per_molk;
  if (row.quantity == "amount_mol") return amount_mol;
  if (row.quantity == "alpha_k_per_j") return (c.cylinder.gas.gamma - 1.0) / cycle.charge.gas_j_per_k;
  if (row.quantity == "pressure_bar") return cycle.pressure_bar(row.at);
  if (row.quantity == "temperature_k") return cycle.temperature_k(row.at);
  if (row.quantity == "nox_arrhenius_ppm") return NoxProxy{}.arrhenius_ppm(cycle.indicators.t_max_k);
  if (row.quantity == "n_compression") {
    return polytropic_exponent(cycle.angles(), cycle.pressures_bar(), c.cylinder, -100.0, -40.0);
  }
  if (row.quantity == "work_booked_j") {
    double booked = 0.0;
    for (std::size_t k = 0; k + 1 < cycle.model.angles_cad().size(); ++k) {
      booked += cycle.model.booked_work_j(k, cycle.work);
    }
    return booked;
  }
  return indicator(cycle.indicators, row.quantity);
}

double computed(const GoldenRow& row) {
  const EngineCase c(row.settings);
  const std::string& q = row.quantity;
  if (q.starts_with("optimum_")) return optimum(c, q.substr(8));
  if (q == "delay_cad") return start_of_combustion(c.cylinder, c.point, c.soi_cad).delay_cad;
  if (q == "ignition_soc_cad") return start_of_combustion(c.cylinder, c.point, c.soi_cad).soc_cad;
  const double volume = geometry(c, row);
  return std::isnan(volume) ? simulated(c, row) : volume;
}

TEST(EngineGolden, EveryReferenceNumberHolds) {
  int rows = 0;
  for (const GoldenRow& row : test_support::read_golden()) {
    if (row.quantity.starts_with("fit_")) continue;
    ++rows;
    EXPECT_NEAR(computed(row), row.value, row.tolerance) << row.settings << " -> " << row.quantity << " " << row.at;
  }
  EXPECT_GT(rows, 170);  // the file was read
}

}  // namespace
}  // namespace mgdd::engine
