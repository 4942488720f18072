// Analysis of traces: the way back from a simulated cycle, pegging, TDC errors, and the published figures of the
// measured heavy-duty traces.
#include "mgdd/engine/pressure/pegging.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/charge.hpp"
#include "support/engine_case.hpp"

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

TEST(EngineTrace, AnalysisInvertsTheSimulation) {
  for (const double soc : {-20.0, -6.0, 3.0}) {
    EngineCase c;
    c.soc_cad = soc;
    const TraceAnalysis a = analyze(c, whole(soc));
    EXPECT_NEAR(a.heat_gross_cumulative_j.back() / 856.0, 1.0, 1e-9);
    EXPECT_NEAR(a.heat_net_cumulative_j.back() + run(c).indicators.heat_loss_j, 856.0, 1e-9 * 856.0);
    // A triangle over 30 CAD has burned a tenth after sqrt(0.05) and nine tenths after 1 - sqrt(0.05) of it.
    EXPECT_NEAR(a.ca10_cad, soc + 30.0 * std::sqrt(0.05), 0.1);
    EXPECT_NEAR(a.ca50_cad, soc + 15.0, 0.1);
    EXPECT_NEAR(a.ca90_cad, soc + 30.0 * (1.0 - std::sqrt(0.05)), 0.1);
    EXPECT_NEAR(a.p_max_bar, run(c).indicators.p_max_bar, 1e-9);  // vertex of the same parabola
    EXPECT_NEAR(a.p_max_cad, run(c).indicators.p_max_cad, 1e-9);
    EXPECT_NEAR(a.work_closed_j, run(c).indicators.work_closed_j, 1e-9);
  }
}

TEST(EngineTrace, NetHeatPutsTheMiddleEarlier) {
  EngineCase c;
  for (const auto& [soc, expected] : {std::pair{-6.0, 8.70}, std::pair{-20.0, -5.72}}) {
    c.soc_cad = soc;
    TraceOptions o = whole(soc);
    o.heat_from_cad = soc;
    o.fractions = BurnFractions::net;
    EXPECT_NEAR(analyze(c, o).ca50_cad, expected, 0.01);
  }
}

TEST(EngineTrace, AnotherGammaOrIntegratorShiftsTheHeatByKnownAmounts) {
  for (const auto& [gamma, percent] :
       {std::pair{1.30, 7.7}, std::pair{1.33, 4.0}, std::pair{1.35, 1.9}, std::pair{1.40, -2.5}}) {
    TraceOptions o = whole(-6.0);
    o.gamma_source = AnalysisGamma::constant;
    o.gamma = gamma;
    EXPECT_NEAR(100.0 * (analyze(EngineCase(), o).heat_gross_cumulative_j.back() / 856.0 - 1.0), percent, 0.3);
  }
  for (const auto& [name, percent] :
       {std::pair{"split", 9e-3}, std::pair{"euler", -2.4}, std::pair{"tan2018_lagged", 2.6}}) {
    const EngineCase c("integrator=" + std::string(name));
    const double error = 100.0 * (analyze(c, whole(-6.0)).heat_gross_cumulative_j.back() / 856.0 - 1.0);
    EXPECT_NEAR(error, percent, name == std::string("split") ? 1e-3 : 0.05) << name;
  }
}

TEST(EngineTrace, PeggingRecoversAnOffset) {
  const EngineCase c("fuel_mg=0 wall_heat_scale=0");
  const Cycle cycle = run(c);
  TraceOptions o;
  o.pegging_exponent = 1.37;
  for (const double offset : {-0.3, -0.1, 0.2, 0.3}) {
    std::vector<double> p = cycle.pressures_bar();
    for (double& x : p) {
      x += offset;
    }
    o.pegging = Pegging::two_point;
    EXPECT_NEAR(pegging_of(cycle.angles(), c.cylinder, o)(p.data()), -offset, 0.005);
    o.pegging = Pegging::least_squares;
    EXPECT_NEAR(pegging_of(cycle.angles(), c.cylinder, o)(p.data()), -offset, 0.005);
    const TraceAnalysis a = analyze_trace(cycle.angles(), p, c.cylinder, c.point, o);
    EXPECT_NEAR(a.pressure_bar[100], cycle.pressures_bar()[100], 0.005);
    EXPECT_NEAR(a.n_compression, 1.37, 2e-3);
  }
  o.pegging = Pegging::none;
  EXPECT_EQ(pegging_of(cycle.angles(), c.cylinder, o)(cycle.pressures_bar().data()), 0.0);
}

TEST(EngineTrace, InletPeggingTakesTheMeanAroundBottomDeadCentre) {
  std::vector<double> angle, p;
  for (double a = -200.0; a <= 130.0; a += 1.0) {
    angle.push_back(a);
    const double away = a + 180.0;  // the mean of its square over -5 ... 5 is 10
    p.push_back(a < -160.0 ? 0.9 + 0.01 * away + 1e-3 * away * away : 3.0);
  }
  TraceOptions o;
  o.pegging = Pegging::inlet;
  o.inlet_pressure_kpa = 150.0;
  EXPECT_NEAR(pegging_of(angle, Cylinder{}, o)(p.data()), 1.5 - 0.91, 1e-12);
  angle.erase(angle.begin(), angle.begin() + 30);
  p.erase(p.begin(), p.begin() + 30);
  EXPECT_THROW(pegging_of(angle, Cylinder{}, o), DataError);
  o.inlet_pressure_kpa = 0.0;
  EXPECT_THROW(pegging_of(angle, Cylinder{}, o), ParameterError);
}

TEST(EngineTrace, OneDegreeOfTdcErrorCostsNinePercentOfImep) {
  EngineCase c;
  const Geometry<double> g(c.cylinder.geometry);
  const auto change_percent = [&](double offset) {
    const Cycle cycle = run(c);
    const std::vector<double> p = cycle.pressures_bar(), angle = cycle.angles();
    double shifted = 0.0, right = 0.0;
    for (std::size_t k = 0; k + 1 < p.size(); ++k) {
      shifted += (p[k] + p[k + 1]) * (g.volume_m3(angle[k + 1] + offset) - g.volume_m3(angle[k] + offset));
      right += (p[k] + p[k + 1]) * (g.volume_m3(angle[k + 1]) - g.volume_m3(angle[k]));
    }
    return 100.0 * (shifted / right - 1.0);
  };
  EXPECT_NEAR(change_percent(1.0), 9.09, 0.1);
  EXPECT_NEAR(change_percent(-1.0), -9.14, 0.1);
  EXPECT_NEAR(change_percent(0.1), 0.91, 0.1);
  for (const auto& [soc, percent] : {std::pair{-20.0, 12.8}, std::pair{0.0, 8.4}, std::pair{10.0, 8.1}}) {
    c.soc_cad = soc;
    EXPECT_NEAR(change_percent(1.0), percent, 0.1);
  }
}

TEST(EngineTrace, MeasuredHeavyDutyTracesGiveTheirPublishedFigures) {
  const auto traces = test_support::hd_traces();
  struct Figures {
    double p_max, p_max_at, n_compression, n_expansion, work_j, imep, ca50, heat_j, ca50_split;
  };
  constexpr Figures figures[] = {{126.5, 6, 1.377, 1.347, 1331.6, 7.19, 5.0, 2316, 4.6},
                                 {183.5, 8, 1.382, 1.330, 2540.1, 13.71, 6.9, 4436, 6.4},
                                 {230.4, 10, 1.378, 1.327, 3737.3, 20.17, 9.4, 6619, 8.9},
                                 {233.2, 10, 1.372, 1.320, 4857.5, 26.21, 14.9, 9090, 14.2}};
  ASSERT_EQ(traces.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& t = traces[i];
    const Figures& f = figures[i];
    TraceOptions o;
    const TraceAnalysis a = analyze_trace(t.angle_cad, t.pressure_bar, test_support::hd_cylinder(), t.point, o);
    ASSERT_EQ(a.angle_cad.size(), 267u);
    const auto top = static_cast<std::size_t>(a.p_max_cad + 143.5);
    EXPECT_NEAR(a.pressure_bar[top], f.p_max, 0.05);
    EXPECT_NEAR(a.p_max_cad, f.p_max_at, 0.5);
    EXPECT_NEAR(a.n_compression, f.n_compression, 1e-3);
    EXPECT_NEAR(a.n_expansion, f.n_expansion, 1e-3);
    EXPECT_NEAR(a.work_closed_j, f.work_j, 0.1);
    EXPECT_NEAR(a.imep_closed_bar, f.imep, 0.01);
    EXPECT_NEAR(a.ca50_cad, f.ca50, 0.06);
    EXPECT_NEAR(a.heat_net_j, f.heat_j, 1.0);
    EXPECT_TRUE(a.warnings.empty());
    o.gamma_source = AnalysisGamma::split;
    EXPECT_NEAR(analyze_trace(t.angle_cad, t.pressure_bar, test_support::hd_cylinder(), t.point, o).ca50_cad,
                f.ca50_split, 0.15);
  }
}

bool says(const TraceAnalysis& a, const std::string& word) {
  return std::any_of(a.warnings.begin(), a.warnings.end(),
                     [&](const TraceWarning& w) { return w.text.find(word) != std::string::npos; });
}

// A motored peak lies 0.1 to 1.5 CAD before TDC; three degrees beside that is a TDC error on either side.
TEST(EngineTrace, AMotoredPeakFarFromTopDeadCentreIsNoticed) {
  const EngineCase c("fuel_mg=0");
  const Cycle cycle = run(c);
  for (const double error : {-3.0, 3.0}) {
    std::vector<double> angle = cycle.angles();
    for (double& a : angle) {
      a += error;
    }
    EXPECT_TRUE(says(analyze_trace(angle, cycle.pressures_bar(), c.cylinder, c.point, {}), "TDC")) << error;
  }
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

}  // namespace
}  // namespace mgdd::engine
