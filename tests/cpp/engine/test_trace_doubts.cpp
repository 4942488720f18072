// Warnings and refusals of the analysis: each is raised by what it names, and by nothing else.
#include "mgdd/engine/pressure/doubts.hpp"

#include "mgdd/engine/charge.hpp"
#include "mgdd/engine/pressure/pegging.hpp"
#include "support/engine_case.hpp"
#include "support/test.hpp"

namespace mgdd::engine {
namespace {

using test_support::EngineCase;

OperatingPoint with_mass(const EngineCase& c) {
  OperatingPoint point = c.point;
  point.trapped_mass_g = mass_of_gas_g(run(c).charge.gas_j_per_k);
  return point;
}

// Analysis of a simulated cycle: pressure times `factor` plus `offset_bar`, angles plus `angle_error`, noise of 0.05.
TraceAnalysis analyze(const EngineCase& c, double offset_bar = 0.0, double angle_error = 0.0, double factor = 1.0,
                      const TraceOptions& options = {}, unsigned seed = 4) {
  const auto cycle = run(c);
  std::vector<double> angle = cycle.angles(), pressure = cycle.pressures_bar();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 0.05);
  for (std::size_t k = 0; k < angle.size(); ++k) {
    angle[k] += angle_error;
    pressure[k] = factor * (pressure[k] + noise(random)) + offset_bar;
  }
  return analyze_trace(angle, pressure, c.cylinder, with_mass(c), options);
}

std::string text_of(const TraceAnalysis& a, std::string_view kind) {
  for (const TraceWarning& w : a.warnings) {
    if (w.kind == kind) return w.text;
  }
  return "";
}

const char* const engines[] = {
    "step_cad=0.5", "step_cad=0.5 gamma_model=linear wall_heat_scale=1.2 intake_pressure_kpa=110 fuel_mg=9",
    "step_cad=0.5 gamma=1.34 intake_pressure_kpa=240 fuel_mg=45 soc_cad=-12 wall_heat_scale=0.3"};

// p + offset = C V^-n holds exactly for an adiabatic compression of constant gamma: the error comes back, reversed.
TEST(EngineDoubts, TheFreePolytropeGivesBackTheErrorOfLevel) {
  const EngineCase c("wall_heat_scale=0 step_cad=0.5 fuel_mg=0");
  const auto cycle = run(c);
  const Geometry<double> g(c.cylinder.geometry);
  const std::vector<double> p = cycle.pressures_bar();
  std::vector<double> v;
  for (const double a : cycle.angles())
    v.push_back(g.volume_m3(a));
  for (const double error : {-0.25, 0.0, 0.4}) {
    std::vector<double> q = p;
    for (double& x : q)
      x += error;
    const FreePolytrope f = free_polytrope(cycle.angles(), q, v, -110.0, -30.0);
    EXPECT_NEAR(f.offset_bar, -error, 2e-3);
    EXPECT_NEAR(f.exponent, 1.37, 2e-3);
  }
  EXPECT_TRUE(std::isnan(free_polytrope(cycle.angles(), p, v, -70.0, -31.0).offset_bar));  // less than 40 CAD
}

// A compression of p V^n = const has exactly this n: 1.24 and 1.43 lie outside of the limits, 1.26 and 1.41 inside.
TEST(EngineDoubts, TheExponentOfCompressionHasTwoLimits) {
  const Geometry<double> g{GeometryParameters<double>{}};
  for (const auto& [exponent, doubted] :
       {std::pair{1.24, true}, std::pair{1.26, false}, std::pair{1.41, false}, std::pair{1.43, true}}) {
    std::vector<double> angle, pressure;
    for (double a = -140.0; a <= 130.0; a += 1.0) {
      angle.push_back(a);
      pressure.push_back(1.5 * std::pow(g.volume_m3(a) / g.volume_m3(-140.0), -exponent));
    }
    const auto a = analyze_trace(angle, pressure, Cylinder{}, OperatingPoint{}, {});
    EXPECT_EQ(!text_of(a, "compression").empty(), doubted) << exponent;
    EXPECT_NEAR(a.n_compression, exponent, 1e-12);
  }
}

// Gross IMEP of the simulation lies between the closed one and the bound on what is open.
TEST(EngineDoubts, TheOpenPartIsBoundedFromAbove) {
  for (const char* settings : engines) {
    const EngineCase c(settings);
    const auto cycle = run(c);
    const auto a = analyze_trace(cycle.angles(), cycle.pressures_bar(), c.cylinder, with_mass(c), {});
    const double open = cycle.indicators.imep_gross_bar - cycle.indicators.imep_closed_bar;
    EXPECT_GT(open_part_at_most_bar(a, c.cylinder), open) << settings;
    EXPECT_LT(open_part_at_most_bar(a, c.cylinder), open + 0.6) << settings;
  }
}

TEST(EngineDoubts, ACa50ThatHangsOnItsWindowIsNamed) {
  TraceOptions o;
  o.heat_from_cad = -20.0;
  o.heat_to_cad = 10.0;  // in the middle of the burn, which ends at 24
  EXPECT_NE(text_of(analyze(EngineCase("step_cad=0.5"), 0.0, 0.0, 1.0, o), "window_sensitivity").find("CA50 moves by"),
            std::string::npos);
}

}  // namespace
}  // namespace mgdd::engine
