// Analysis of a trace, its options, and its warnings: each is raised by what it names, and by nothing else.
#include "mgdd/common/error.hpp"
#include "mgdd/engine/charge.hpp"
#include "mgdd/engine/pressure/doubts.hpp"
#include "mgdd/engine/pressure/pegging.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "mgdd/engine/pressure/trace_options.hpp"
#include "support/engine_case.hpp"
#include "support/test.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;

TraceOptions whole(double soc_cad) {
  TraceOptions o;
  o.gamma_source = AnalysisGamma::cylinder;
  o.heat_from_cad = -140.0;
  o.heat_to_cad = 130.0;
  o.burn_from_cad = soc_cad;
  o.fractions = BurnFractions::gross;
  return o;
}

OperatingPoint with_mass(const EngineCase& c) {
  OperatingPoint point = c.point;
  point.trapped_mass_g = mass_of_gas_g(run(c).charge.gas_j_per_k);
  return point;
}

TraceAnalysis analyze(const EngineCase& c, const TraceOptions& options) {
  const Cycle cycle = run(c);
  return analyze_trace(cycle.angles(), cycle.pressures_bar(), c.cylinder, with_mass(c), options);
}

bool says(const TraceAnalysis& a, const std::string& word) {
  return std::any_of(a.warnings.begin(), a.warnings.end(),
                     [&](const TraceWarning& w) { return w.text.find(word) != std::string::npos; });
}

TEST(EngineTrace, ALittleFuelIsNotTakenForNone) {
  for (const auto& [fuel, motored] : {std::pair{"0", true}, std::pair{"3", false}, std::pair{"20", false}}) {
    EXPECT_EQ(analyze(EngineCase("fuel_mg=" + std::string(fuel)), TraceOptions{}).motored, motored) << fuel;
  }
  for (const auto& trace : test_support::hd_traces()) {
    EXPECT_FALSE(
        analyze_trace(trace.angle_cad, trace.pressure_bar, test_support::hd_cylinder(), trace.point, {}).motored);
  }
}

TEST(EngineTrace, ASoundTraceRaisesNoWarning) {
  for (const char* settings : {"", "fuel_mg=0", "fuel_mg=8", "soc_cad=3"}) {
    const EngineCase c(settings);
    const TraceAnalysis a = analyze(c, TraceOptions{});
    EXPECT_TRUE(a.warnings.empty()) << settings << ": " << (a.warnings.empty() ? "" : a.warnings.front().text);
  }
}

// A steep flank is not a spike: what counts is the distance from the mean of both neighbours.
TEST(EngineTrace, ASpikeIsToldFromASteepFlank) {
  const EngineCase c("step_cad=5 soc_cad=-2");
  const Cycle cycle = run(c);
  std::vector<double> pressure = cycle.pressures_bar();
  const double top = *std::ranges::max_element(pressure);
  double steepest = 0.0;
  for (std::size_t k = 1; k < pressure.size(); ++k)
    steepest = std::max(steepest, pressure[k] - pressure[k - 1]);
  ASSERT_GT(steepest, 0.12 * top);
  EXPECT_FALSE(says(analyze_trace(cycle.angles(), pressure, c.cylinder, c.point, {}), "neighbours"));
  pressure[pressure.size() / 3] += 0.15 * top;
  EXPECT_TRUE(says(analyze_trace(cycle.angles(), pressure, c.cylinder, c.point, {}), "neighbours"));
}

// Without wall heat and at one gamma the exponent is gamma on both sides, and the pressure by combustion is (gamma - 1)
// times the heat over the smallest volume.
TEST(EngineTrace, PressureByCombustionGoesWithTheHeat) {
  EngineCase c("wall_heat_scale=0 gamma=1.35 step_cad=0.1");
  for (const double soc : {-15.0, -6.0, 3.0}) {
    c.soc_cad = soc;
    TraceOptions o = whole(soc);
    o.fractions = BurnFractions::rassweiler_withrow;
    const TraceAnalysis a = analyze(c, o);
    EXPECT_NEAR(a.n_compression, 1.35, 1e-3);
    EXPECT_NEAR(a.ca10_cad, soc + 30.0 * std::sqrt(0.05), 0.05) << soc;
    EXPECT_NEAR(a.ca50_cad, soc + 15.0, 0.05) << soc;
    EXPECT_NEAR(a.ca90_cad, soc + 30.0 * (1.0 - std::sqrt(0.05)), 0.05) << soc;
    double sum = 0.0;
    for (const double step : a.pressure_step_bar)
      sum += step;
    EXPECT_NEAR(sum * 1e5 * *std::ranges::min_element(a.volume_l) * 1e-3 / (0.35 * 856.0), 1.0, 3e-3);
  }
}

TEST(EngineTrace, ShareOfPressureNeedsBothExponents) {
  const Cycle cycle = run(EngineCase{});
  std::vector<double> angle, pressure;
  for (std::size_t k = 0; k < cycle.angles().size(); ++k) {
    if (cycle.angles()[k] < -90.0 || cycle.angles()[k] > 50.0) continue;
    angle.push_back(cycle.angles()[k]), pressure.push_back(cycle.pressures_bar()[k]);
  }
  TraceOptions o;
  o.fractions = BurnFractions::rassweiler_withrow;
  try {
    analyze_trace(angle, pressure, Cylinder{}, OperatingPoint{}, o);
    ADD_FAILURE();
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("give the whole closed cycle"), std::string::npos) << error.what();
  }
}

// The window ends while the burn goes on: the last step holds more than the last tenth of the heat, and CA90 lies in
// it.
TEST(EngineTrace, TheLastStepOfTheHeatBelongsToTheBurn) {
  for (const bool gross : {false, true}) {
    TraceOptions o = whole(-6.0);
    o.heat_to_cad = 5.0;
    o.fractions = gross ? BurnFractions::gross : BurnFractions::net;
    const TraceAnalysis a = analyze(EngineCase("step_cad=2.5"), o);
    const std::vector<double>& heat = gross ? a.heat_gross_cumulative_j : a.heat_net_cumulative_j;
    const auto last = static_cast<std::size_t>(std::ranges::find(a.angle_cad, 5.0) - a.angle_cad.begin());
    ASSERT_LT(last, a.angle_cad.size());
    const double level = 0.9 * heat[last];
    ASSERT_LT(heat[last - 1], level);
    EXPECT_NEAR(a.ca90_cad, 2.5 + 2.5 * (level - heat[last - 1]) / (heat[last] - heat[last - 1]), 1e-9) << gross;
  }
}

// Of an expansion alone the pressure rises nowhere: its largest rate is the least fall, at the end.
TEST(EngineTrace, TheLargestRateOfAFallingTraceIsNegative) {
  const Geometry<double> g{GeometryParameters<double>{}};
  std::vector<double> angle, p;
  for (double a = 30.0; a <= 130.0; a += 1.0) {
    angle.push_back(a);
    p.push_back(30.0 * std::pow(g.volume_m3(a) / g.volume_m3(30.0), -1.3));
  }
  const std::size_t n = p.size();
  const TraceAnalysis found = analyze_trace(angle, p, Cylinder{}, OperatingPoint{}, TraceOptions{});
  EXPECT_NEAR(found.dp_max_bar_per_cad, 0.5 * (p[n - 1] - p[n - 3]), 2e-6);  // the slope of a line over 2 CAD
  EXPECT_LT(found.dp_max_bar_per_cad, 0.0);
}

TEST(EngineTrace, RatesAreTheHeatOfAStepByItsLength) {
  TraceAnalysis a;
  a.angle_cad = {-3.0, -2.0, 0.5};
  a.net_step_j = {0.0, 4.0, -10.0};
  a.loss_step_j = {0.0, 1.0, 5.0};
  EXPECT_EQ(a.heat_release_net_j_per_cad(), (std::vector{0.0, 4.0, -4.0}));
  EXPECT_EQ(a.heat_loss_j_per_cad(), (std::vector{0.0, 1.0, 2.0}));
  EXPECT_EQ(a.heat_release_gross_j_per_cad(), (std::vector{0.0, 5.0, -2.0}));
}

TEST(EngineTrace, PolytropicExponentOfAPolytropicTrace) {
  const Geometry<double> g{GeometryParameters<double>{}};
  std::vector<double> angle, p;
  for (double a = -140.0; a <= 130.0; a += 1.0) {
    angle.push_back(a);
    p.push_back(2.0 * std::pow(g.volume_m3(a), -1.31));
  }
  EXPECT_NEAR(polytropic_exponent(angle, p, Cylinder{}, -100.0, -40.0), 1.31, 1e-12);
  EXPECT_TRUE(std::isnan(polytropic_exponent(angle, p, Cylinder{}, -100.0, -98.5)));
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
