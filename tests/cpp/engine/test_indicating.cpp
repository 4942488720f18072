// Figures of measured cycles: loops of known work, the figures of the whole analysis, a synthetic ringing, no heap.
#include "mgdd/engine/pressure/indicating.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

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
