// Figures of cycles from their records, and the smoothing of a trace.
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/indicating.hpp"
#include "mgdd/engine/pressure/rise_rate.hpp"
#include "mgdd/engine/pressure/smoothing.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

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

Column grid(double from, double to, double step) {
  Column x;
  for (int k = 0; from + k * step <= to + 1e-9; ++k)
    x.push_back(from + k * step);
  return x;
}
template <class F>
Column of(const Column& x, F f) {
  Column y;
  for (const double a : x)
    y.push_back(f(a));
  return y;
}
TraceOptions choose(Smoothing kind, double width = 4.0, double hz = 3000.0) {
  TraceOptions o;
  o.smoothing = kind;
  o.smoothing_width_cad = width;
  o.smoothing_cutoff_hz = hz;
  return o;
}

TEST(EngineSmoothing, ALocalParabolaKeepsParabolasAlsoOnUnevenAngles) {
  Column x = grid(-20.0, 30.0, 0.5);
  for (std::size_t k = 0; k < x.size(); ++k)
    x[k] += 0.1 * std::sin(7.0 * static_cast<double>(k));
  const Column y = of(x, [](double a) { return 3.0 - 0.4 * a + 0.07 * a * a; });
  const Column s = Smoother(x, 1500.0, choose(Smoothing::savitzky_golay, 6.0))(y);
  for (std::size_t k = 0; k < x.size(); ++k)
    EXPECT_NEAR(s[k], y[k], 1e-10);
  // A mean bends a parabola by c times the mean square of the offsets: 0.07 * (0 + 2 (0.5^2 + 1^2)) / 5.
  const Column even = grid(-20.0, 30.0, 0.5);
  const Column p = of(even, [](double a) { return 0.07 * a * a - 0.4 * a; });
  EXPECT_NEAR(Smoother(even, 1500.0, choose(Smoothing::angle_window, 2.0))(p)[31], p[31] + 0.07 * 0.5, 1e-12);
}

// Savitzky and Golay 1964, table I, quadratic and cubic, five points: (-3 12 17 12 -3)/35.
TEST(EngineSmoothing, FivePointsHaveTheWeightsOfTheTable) {
  const Column x = grid(-10.0, 10.0, 1.0);
  const double weights[] = {-3.0 / 35, 12.0 / 35, 17.0 / 35, 12.0 / 35, -3.0 / 35};
  for (int j = 0; j < 5; ++j) {
    Column y(x.size(), 0.0);
    y[8 + static_cast<std::size_t>(j)] = 1.0;
    EXPECT_NEAR(Smoother(x, 1500.0, choose(Smoothing::savitzky_golay, 4.0))(y)[10], weights[j], 1e-12);
  }
}

TEST(EngineSmoothing, EveryKindKeepsThePhaseAndLowersTheNoise) {
  const Column x = grid(-120.0, 120.0, 0.2);
  const auto wave = [](double a) { return std::sin(2.0 * std::numbers::pi * (a - 3.1) / 40.0); };
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.3);
  const Column clean = of(x, wave), noisy = of(x, [&](double a) { return wave(a) + noise(random); });
  for (const Smoothing kind : {Smoothing::savitzky_golay, Smoothing::low_pass, Smoothing::angle_window}) {
    const Smoother smoother(x, 1500.0, choose(kind, 4.0, 2000.0));
    const Column c = smoother(clean), n = smoother(noisy);
    double before = 0.0, after = 0.0, in_phase = 0.0, across = 0.0;
    for (std::size_t k = 200; k < 1000; ++k) {  // four whole periods
      before += std::pow(noisy[k] - clean[k], 2);
      after += std::pow(n[k] - c[k], 2);
      in_phase += c[k] * clean[k];
      across += c[k] * std::cos(2.0 * std::numbers::pi * (x[k] - 3.1) / 40.0);
    }
    EXPECT_LT(after, 0.2 * before) << smoother.name();
    EXPECT_LT(std::abs(across), 1e-3 * in_phase) << smoother.name();
  }
}

// 1500 rpm is 9000 CAD/s: 2000 Hz is one period in 4.5 CAD, and the gain there is 1/2.
TEST(EngineSmoothing, TheLowPassHalvesItsCutoff) {
  const Column x = grid(-120.0, 120.0, 0.25);
  const Column y = of(x, [](double a) { return std::cos(2.0 * std::numbers::pi * a / 4.5); });
  const Column s = Smoother(x, 1500.0, choose(Smoothing::low_pass, 4.0, 2000.0))(y);
  EXPECT_NEAR(s[x.size() / 2], 0.5, 0.01);
}

TEST(EngineSmoothing, TheDefaultActsOnFineTracesOnly) {
  EXPECT_EQ(Smoother(grid(-90.0, 90.0, 0.2), 1500.0, {}).name(), "savitzky_golay over 4 °CA (21 samples)");
  EXPECT_EQ(Smoother(grid(-90.0, 90.0, 0.5), 1500.0, {}).name(), "savitzky_golay over 4 °CA (9 samples)");
  EXPECT_EQ(Smoother(grid(-90.0, 90.0, 1.0), 1500.0, {}).name(), "none");
}

double rise_of(const Column& x, const Column& p) {
  return RiseRate(x)(p.data()).bar_per_cad;
}

// p = c x^3 has the least-squares slope c (3/5) h^2 over [-h, h], h = 1 CAD; a line its own slope.
TEST(EngineRiseRate, IsTheSlopeOfTheLineOverTwoDegrees) {
  for (const double step : {0.05, 0.1, 0.2, 0.5, 1.0}) {
    const Column x = grid(-15.0, 15.0, step);
    EXPECT_NEAR(rise_of(x, of(x, [](double a) { return 7.0 + 2.3 * a; })), 2.3, 1e-9);
    const Column bump = of(x, [](double a) { return 4.0 * std::tanh(a / 3.0); });
    // Exact: 3/2 int_{-1}^{1} u p(u) du by Simpson.
    double integral = 0.0;
    for (int i = 0; i <= 2000; ++i) {
      const double u = -1.0 + 0.001 * i;
      integral += (i == 0 || i == 2000 ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * u * 4.0 * std::tanh(u / 3.0) * 0.001 / 3.0;
    }
    EXPECT_NEAR(rise_of(x, bump), 1.5 * integral, 5e-3 * integral) << step;
  }
}

}  // namespace
}  // namespace mgdd::engine
