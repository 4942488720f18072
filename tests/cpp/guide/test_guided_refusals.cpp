// Answers of the model and pressures that a guided engine cannot use, and guides that it refuses.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/guided_engine_case.hpp"

namespace mgdd::guide {
namespace {

TEST(GuidedEngine, APointOfWhichTheModelSaysNothingIsWaitedFor) {
  const OperatingPoint point;
  for (const bool by_curve : {true, false}) {
    auto bench = bench_at({{0, point}}, 1);
    GuidedEngine guided(
        by_curve ? GuidedEngine::Seeking(curve_seeking(rough_model(), point)) : GuidedEngine::Seeking(trimmed()),
        rough_model(), std::nullopt, point);
    path_of(bench, guided, 60);
    const double held = guided.estimate()[0];
    OperatingPoint motored = point, broken = point;
    motored.fuel_mg = 0.0;
    broken.speed_rpm = std::nan("");
    EXPECT_EQ(guided.at(broken), GuideStatus::refused);
    EXPECT_EQ(guided.estimate()[0], held);
    EXPECT_EQ(guided.at(motored), GuideStatus::refused);
    EXPECT_EQ(guided.at(motored), GuideStatus::refused);
    EXPECT_EQ(guided.estimate()[0], held) << "what it said last stands";
    EXPECT_EQ(guided.refusals(), 3);
    EXPECT_EQ(guided.at(point), GuideStatus::followed);
    path_of(bench, guided, 20);
    guided.ask();
    EXPECT_EQ(guided.at(motored), GuideStatus::busy);
  }
}

// The model's best timing of the second point lies below the bounds: the seeker begins anew there, once, and goes on.
TEST(GuidedEngine, ACurveOutOfTheBoundsIsWaitedForWhileTheSeekerLearns) {
  OperatingPoint low, high;
  high.fuel_mg = 34.0;
  CurveSeekingSettings s = curve_settings(rough_model(), low);
  const double other = curve_settings(rough_model(), high).curve.best();
  s.space.lower = scalar_input(0.5 * (s.curve.best() + other));
  ASSERT_LT(other, s.curve.best() - 1.0);
  CurveSeeking alone(s);
  GuidedEngine guided(CurveSeeking(s), rough_model(), std::nullopt, low);
  auto bench = bench_at({{0, low}, {40, high}}, 4);
  for (int k = 0; k < 120; ++k) {
    EXPECT_EQ(guided.at(bench.point()), k < 40 ? GuideStatus::followed : GuideStatus::refused);
    if (k == 40) alone.restart();
    const double x = alone.ask()[0];
    ASSERT_EQ(guided.ask()[0], x) << "cycle " << k;
    const loop::BenchCycle c = bench.step(x);
    const double j[] = {c.j};
    guided.tell({j, {}, c.misfire});
    alone.tell({j, {}, c.misfire});
  }
  EXPECT_NEAR(guided.estimate()[0], s.space.lower[0], 0.5) << "the plant's best lies below the bounds too";
}

TEST(GuidedEngine, AFeedForwardOutOfTheBoundsIsWaitedForWhileTheSeekerLearns) {
  OperatingPoint low, high;
  high.fuel_mg = 34.0;
  const double first = rough_model().find(low).soc_cad, other = rough_model().find(high).soc_cad;
  optimize::ExtremumSeekingSettings s;
  s.space = {scalar_input(4.0), scalar_input(0.5 * (first + other)), scalar_input(10.0), {}};
  s.dither.amplitude = scalar_input(1.0);
  optimize::ExtremumSeeking alone(s);
  const FeedForward seeker{optimize::VariantSeeker(optimize::ExtremumSeeking(s))};
  GuidedEngine guided(seeker, rough_model(), std::nullopt, low, {.keep_start = true});
  auto bench = bench_at({{0, low}, {40, high}}, 4);
  for (int k = 0; k < 300; ++k) {
    EXPECT_EQ(guided.at(bench.point()), k < 40 ? GuideStatus::followed : GuideStatus::refused);
    if (k == 40) alone.restart();
    const double x = alone.ask()[0];
    ASSERT_EQ(guided.ask()[0], x) << "cycle " << k;
    const loop::BenchCycle c = bench.step(x);
    const double j[] = {c.j};
    guided.tell({j, {}, c.misfire});
    alone.tell({j, {}, c.misfire});
  }
  EXPECT_LT(guided.estimate()[0], s.space.lower[0] + 2.5) << "the plant's best lies below the bounds too";
}

TEST(GuidedEngine, BadPressureNeverReachesTheCalibration) {
  const OperatingPoint point;
  auto bench = bench_at({{0, point}}, 2);
  GuidedEngine guided(curve_seeking(rough_model(), point), rough_model(), calibration(), point);
  for (int k = 0; k < 40; ++k) {
    const loop::BenchCycle c = bench.step(guided.ask()[0]);
    const auto trace = bench.pressure().pressure_bar;
    std::vector<double> spoilt(trace.begin(), trace.end());
    if (k % 3 == 0) spoilt[40] = std::nan("");
    if (k % 3 == 1) spoilt.pop_back();
    if (k % 3 == 2) {
      for (double& p : spoilt)
        p = std::min(p, 60.0);
    }
    const double j[] = {c.j};
    EXPECT_EQ(guided.tell({j, {}, false}, spoilt), TellStatus::accepted);
  }
  const auto& calibrated = guided.calibration();
  ASSERT_TRUE(calibrated.has_value());
  EXPECT_EQ(calibrated->accepted(), 0);
  EXPECT_EQ(guided.recalibrations(), 0);
  EXPECT_NEAR(guided.estimate()[0], plant_best_cad, 1.5) << "the seeker goes on";
}

TEST(GuidedEngine, RefusesAGuideThatCannotGuide) {
  OperatingPoint point, motored;
  motored.fuel_mg = 0.0;
  EXPECT_THROW(GuidedEngine(curve_seeking(rough_model(), point), rough_model(), std::nullopt, motored), ParameterError);
  engine::Cylinder wide = rough_cylinder();
  wide.geometry.bore_mm = 90.0;
  ModelOptimumSettings s;
  s.cylinder = wide;
  EXPECT_THROW(GuidedEngine(curve_seeking(rough_model(), point), ModelOptimum(s), calibration(), point),
               ParameterError);
  EXPECT_THROW(GuidedEngine(trimmed(), rough_model(), std::nullopt, point, {.changed_share = 0.0}), ParameterError);
}

}  // namespace
}  // namespace mgdd::guide
