// Figures of measured cycles: loops of known work, the figures of the whole analysis, a synthetic ringing, no heap.
#include "mgdd/engine/pressure/indicating.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;
using test_support::EngineCase;

constexpr double speed_rpm = 1500.0;

Column angles(double from, double step, std::size_t n) {
  Column out;
  for (std::size_t k = 0; k < n; ++k)
    out.push_back(from + step * static_cast<double>(k));
  return out;
}

template <class Pressure>
Column over(const Column& angle, const Pressure& pressure) {
  Column out;
  for (const double a : angle)
    out.push_back(pressure(a));
  return out;
}

CycleFigures figures(const Column& angle, const Column& pressure, const TraceOptions& options = {},
                     double speed = speed_rpm) {
  const Indicating indicating(angle, Cylinder{}, speed, options);
  Indicating::Workspace work = indicating.make_workspace();
  return indicating(pressure.data(), work);
}

// Intake at 1.4 bar, compression and expansion along one polytrope, exhaust at 1.9 bar: all of the work is pumping.
double motored(double angle) {
  const Geometry<double> g(Cylinder{}.geometry);
  if (angle < -180.0) return 1.4;
  if (angle >= 180.0) return 1.9;
  return 1.4 * std::pow(g.volume_m3(-180.0) / g.volume_m3(angle), 1.33);
}

TEST(EngineIndicating, PumpingWorkIsTheDifferenceOfTheLevels) {
  for (const double start : {-360.0, -359.93}) {
    const Column angle = angles(start, 0.1, 7200);
    const CycleFigures f = figures(angle, over(angle, motored));
    EXPECT_NEAR(f.imep_gross_bar, 0.0, 2e-5);
    EXPECT_NEAR(f.imep_net_bar, 1.4 - 1.9, 1e-4) << start;
    EXPECT_NEAR(f.pmep_bar, -0.5, 1e-4);
    EXPECT_NEAR(f.n_compression, 1.33, 1e-9);
    EXPECT_NEAR(f.n_expansion, 1.33, 1e-9);
    EXPECT_TRUE(std::isnan(f.ca50_cad));
    EXPECT_LT(std::abs(f.mapo_bar), 5e-3);
  }
}

TEST(EngineIndicating, WhatARecordDoesNotReachIsNotANumber) {
  const auto half = angles(-180.0, 0.5, 721);
  const CycleFigures gross = figures(half, over(half, motored));
  EXPECT_FALSE(std::isnan(gross.imep_gross_bar));
  EXPECT_TRUE(std::isnan(gross.imep_net_bar) && std::isnan(gross.pmep_bar));
  const auto closed = angles(-130.0, 0.5, 481);
  const CycleFigures least = figures(closed, over(closed, motored));
  EXPECT_TRUE(std::isnan(least.imep_gross_bar));
  EXPECT_FALSE(std::isnan(least.imep_closed_bar));
}

// Without smoothing and in one window the whole analysis finds the same.
TEST(EngineIndicating, AgreesWithTheWholeAnalysis) {
  const EngineCase c("step_cad=0.2 soc_cad=-4 ivc_temperature_k=340");
  const auto cycle = run(c);
  TraceOptions o;
  o.smoothing = Smoothing::none;
  o.heat_from_cad = -20.0, o.heat_to_cad = 70.0;
  o.pegging = Pegging::least_squares;
  Column raw = cycle.pressures_bar();
  for (double& p : raw)
    p -= 0.4;
  const TraceAnalysis a = analyze_trace(cycle.angles(), raw, c.cylinder, c.point, o);
  const Indicating indicating(cycle.angles(), c.cylinder, c.point.speed_rpm, o);
  Indicating::Workspace work = indicating.make_workspace();
  const CycleFigures f = indicating(raw.data(), work);
  EXPECT_NEAR(f.pegging_bar, 0.4, 0.1);  // wall heat takes part in the compression
  for (const Figure<CycleFigures>& figure : cycle_figures) {
    const double whole = a.*(figure.member), alone = f.*(figure.member);
    EXPECT_EQ(std::isnan(whole), std::isnan(alone)) << figure.name;
    if (std::isnan(whole)) continue;
    EXPECT_NEAR(alone, whole, 1e-9 * (1.0 + std::abs(whole))) << figure.name;
  }
  EXPECT_NEAR(f.imep_closed_bar, cycle.indicators.imep_closed_bar, 5e-4 * cycle.indicators.imep_closed_bar);
  EXPECT_NEAR(f.p_max_bar, cycle.indicators.p_max_bar + f.pegging_bar - 0.4, 1e-9);
}

// A damped ringing of 6.5 kHz on a smooth cycle.
TEST(EngineIndicating, FindsARinging) {
  const Column angle = angles(-360.0, 0.1, 7200);
  const double degrees_per_s = units::cad_per_s_per_rpm * speed_rpm, amplitude = 2.5;
  const double rate = 2.0 * std::numbers::pi * 6500.0 / degrees_per_s, decay = 0.08;
  const auto ringing = [&](double a) {
    return a < 5.0 ? 0.0 : amplitude * std::exp(-decay * (a - 5.0)) * std::sin(rate * (a - 5.0));
  };
  const CycleFigures f = figures(angle, over(angle, [&](double a) { return motored(a) + ringing(a); }));
  double largest = 0.0, integral = 0.0, square = 0.0;
  for (double a = 5.0; a < 90.0; a += 1e-3) {
    const double x = ringing(a);
    largest = std::max(largest, std::abs(x)), integral += std::abs(x) * 1e-3, square += x * x * 1e-3;
  }
  EXPECT_NEAR(f.mapo_bar / largest, 1.0, 0.05);  // the onset is not a tone
  EXPECT_NEAR(f.impo_bar_cad / integral, 1.0, 0.03);
  EXPECT_NEAR(f.sepo_bar2_cad / square, 1.0, 0.03);

  const auto steady = [&](double a) { return motored(a) + amplitude * std::sin(rate * a); };
  const CycleFigures tone = figures(angle, over(angle, steady));
  EXPECT_NEAR(tone.mapo_bar, amplitude, 0.01 * amplitude);
  EXPECT_NEAR(tone.impo_bar_cad, amplitude * 2.0 / std::numbers::pi * 100.0, 0.01 * amplitude * 64.0);
  EXPECT_NEAR(tone.sepo_bar2_cad, 0.5 * amplitude * amplitude * 100.0, 0.01 * 0.5 * amplitude * amplitude * 100.0);
}

TEST(EngineIndicating, KnockNeedsASamplingThatReachesItsBand) {
  const Column coarse = angles(-360.0, 1.0, 720);  // Nyquist 4.5 kHz
  EXPECT_TRUE(std::isnan(figures(coarse, over(coarse, motored)).mapo_bar));
  EXPECT_FALSE(std::isnan(figures(coarse, over(coarse, motored), {}, 4.0 * speed_rpm).mapo_bar));
  Column uneven = angles(-360.0, 0.2, 3600);
  uneven[1700] += 0.05;
  EXPECT_TRUE(std::isnan(figures(uneven, over(uneven, motored)).mapo_bar));
}

TEST(EngineIndicating, PeggingMovesTheLevelAndNotTheWorkOfALoop) {
  const Column angle = angles(-360.0, 0.2, 3600);
  for (const auto method : {Pegging::inlet, Pegging::two_point, Pegging::least_squares}) {
    TraceOptions o;
    o.pegging = method;
    o.pegging_exponent = 1.33;
    o.inlet_pressure_kpa = 140.0;
    const Column p = over(angle, [](double a) { return motored(a) - 3.0; });
    const CycleFigures f = figures(angle, p, o), sound = figures(angle, over(angle, motored));
    EXPECT_NEAR(f.pegging_bar, 3.0, 0.02);
    EXPECT_NEAR(f.imep_net_bar, sound.imep_net_bar, 1e-9);
    EXPECT_NEAR(f.p_max_bar, sound.p_max_bar + f.pegging_bar - 3.0, 1e-9);
    EXPECT_NEAR(f.imep_closed_bar, sound.imep_closed_bar, 1e-3);
  }
}

TEST(EngineIndicating, ManyCyclesAreEachAlone) {
  const Column angle = angles(-360.0, 0.2, 3600);
  const Indicating indicating(angle, Cylinder{}, speed_rpm, {});
  Indicating::Workspace work = indicating.make_workspace();
  Column record;
  for (int c = 0; c < 5; ++c) {
    for (const double a : angle)
      record.push_back((1.0 + 0.02 * c) * motored(a) + 30.0 * c * std::exp(-0.01 * std::pow(a - 8.0 - c, 2)));
  }
  for (const std::size_t threads : {1u, 3u}) {
    const auto all = indicate_cycles(indicating, record, threads);
    ASSERT_EQ(all.size(), 5u);
    for (std::size_t c = 0; c < 5; ++c) {
      const CycleFigures alone = indicating(record.data() + c * angle.size(), work);
      for (const Figure<CycleFigures>& figure : cycle_figures) {
        const double a = all[c].*(figure.member), b = alone.*(figure.member);
        EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << figure.name;
      }
    }
    EXPECT_TRUE(std::isnan(all[0].ca50_cad));
    EXPECT_GT(all[4].ca50_cad, all[1].ca50_cad);
  }
}

TEST(EngineIndicating, ACycleThatIsNotFiniteIsNamed) {
  const Column angle = angles(-360.0, 1.0, 720);
  const Indicating indicating(angle, Cylinder{}, speed_rpm, {});
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 7000.0}) {
    Column record = over(angle, motored);
    record.insert(record.end(), record.begin(), record.end());
    record[720 + 340] = bad;
    try {
      indicate_cycles(indicating, record);
      FAIL() << bad;
    } catch (const DataError& error) {
      EXPECT_NE(std::string(error.what()).find("cycle 2: "), std::string::npos) << error.what();
    }
    Indicating::Workspace work = indicating.make_workspace();
    EXPECT_EQ(std::isnan(indicating(record.data() + 720, work).imep_gross_bar), !std::isfinite(bad));
  }
  EXPECT_THROW(indicate_cycles(indicating, Column(1000, 1.0)), ShapeError);
  TraceOptions o;
  o.gamma_source = AnalysisGamma::split;
  EXPECT_THROW(Indicating(angle, Cylinder{}, speed_rpm, o), ParameterError);
  for (const double bad : {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    EXPECT_THROW(Indicating(angle, Cylinder{}, bad, {}), ParameterError);
}

TEST(EngineIndicating, AllocatesNothing) {
  const Column angle = angles(-360.0, 0.2, 3600);
  const Column p = over(angle, motored);
  TraceOptions o;
  o.pegging = Pegging::two_point;
  const Indicating indicating(angle, Cylinder{}, speed_rpm, o);
  Indicating::Workspace work = indicating.make_workspace();
  static_assert(noexcept(indicating(p.data(), work)));
  CycleFigures f = indicating(p.data(), work);
  const test_support::AllocationCounter counter;
  for (int i = 0; i < 3; ++i)
    f = indicating(p.data(), work);
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_FALSE(std::isnan(f.mapo_bar));
}

}  // namespace
}  // namespace mgdd::engine
