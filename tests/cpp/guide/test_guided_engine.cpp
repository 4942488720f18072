// The whole guided loop on the virtual bench: arrival, new points, calibration without a jump, refusals, real time.
#include "mgdd/guide/guided_engine.hpp"

#include <cmath>
#include <vector>

#include "mgdd/loop/engine_bench.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::guide {
namespace {

using engine::OperatingPoint;
using optimize::scalar_input;
using optimize::TellStatus;

constexpr double plant_best_cad = -5.63;  // of the default cylinder, wall heat 0.5

engine::Cylinder rough_cylinder() {
  engine::Cylinder c;
  c.wall_heat.wall_heat_scale = 1.0;
  return c;
}

ModelOptimum rough_model() {
  ModelOptimumSettings s;
  s.cylinder = rough_cylinder();
  return ModelOptimum(s);
}

CurveSeekingSettings curve_settings(ModelOptimum model, const OperatingPoint& point) {
  CurveSeekingSettings s;
  EXPECT_TRUE(model.tabulate(point, s.curve));
  s.space = {scalar_input(s.curve.best()), scalar_input(-30.0), scalar_input(10.0)};
  return s;
}

CurveSeeking curve_seeking(ModelOptimum model, const OperatingPoint& point) {
  return CurveSeeking(curve_settings(std::move(model), point));
}

FeedForward<optimize::VariantSeeker> trimmed(double start_cad = -15.0) {
  optimize::ExtremumSeekingSettings s;
  s.space = {scalar_input(start_cad), scalar_input(-30.0), scalar_input(10.0)};
  return FeedForward(optimize::VariantSeeker(optimize::ExtremumSeeking(s)));
}

std::optional<OnlineCalibration> calibration() {
  OnlineCalibrationSettings s;
  s.cylinder = rough_cylinder();
  s.window.steady_cycles = 0;
  s.window.window_cycles = 10;
  return std::optional<OnlineCalibration>(std::in_place, s);
}

loop::EngineBench bench_at(std::vector<loop::ScheduledPoint> schedule, std::uint64_t seed) {
  loop::BenchSettings s;
  s.schedule = std::move(schedule);
  s.pressure_noise_bar = 0.05;
  s.seed = seed;
  return loop::EngineBench(s);
}

/// One cycle as 7.2 of the loop has it.
double cycle(loop::EngineBench& bench, GuidedEngine& guided) {
  guided.at(bench.point());
  const loop::BenchCycle c = bench.step(guided.ask()[0]);
  const double j[] = {c.j};
  const auto trace = bench.pressure();
  EXPECT_EQ(guided.tell({j, {}, c.misfire}, trace.pressure_bar),
            c.misfire ? TellStatus::misfire : TellStatus::accepted);
  return guided.estimate()[0];
}

std::vector<double> path_of(loop::EngineBench& bench, GuidedEngine& guided, int cycles) {
  std::vector<double> path;
  for (int k = 0; k < cycles; ++k)
    path.push_back(cycle(bench, guided));
  return path;
}

TEST(GuidedEngine, TheModelLearnsWhileTheEngineSeeks) {
  const OperatingPoint point;
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    auto bench = bench_at({{0, point}}, seed);
    GuidedEngine guided(curve_seeking(rough_model(), point), rough_model(), calibration(), point);
    EXPECT_NEAR(guided.now().guide_cad, -1.5, 0.2);
    const std::vector<double> path = path_of(bench, guided, 60);
    EXPECT_NEAR(guided.calibration()->cylinder().wall_heat.wall_heat_scale, 0.5, 0.025);
    EXPECT_NEAR(guided.now().guide_cad, plant_best_cad, 0.4) << "the calibrated model says where the plant's best is";
    EXPECT_GT(guided.recalibrations(), 0);
    EXPECT_NEAR(path.back(), plant_best_cad, 1.2);
  }
}

TEST(GuidedEngine, ACalibrationDoesNotMoveAFeedForwardsTiming) {
  const OperatingPoint point;
  auto bench = bench_at({{0, point}}, 3), same = bench_at({{0, point}}, 3);
  GuidedEngine learning(trimmed(), rough_model(), calibration(), point);
  GuidedEngine fixed(trimmed(), rough_model(), std::nullopt, point);
  for (int k = 0; k < 80; ++k)
    ASSERT_NEAR(cycle(bench, learning), cycle(same, fixed), 1e-9) << "cycle " << k;
  const GuidedCycle now = learning.now(), before = fixed.now();
  EXPECT_NEAR(now.feed_forward_cad, plant_best_cad, 0.5);
  EXPECT_NEAR(now.feed_forward_cad + now.trim_cad, before.feed_forward_cad + before.trim_cad, 1e-9);
  EXPECT_LT(std::abs(now.trim_cad), std::abs(before.trim_cad)) << "the trim hands over what the model has learnt";
}

// The guide's optimum is -1.5 CAD: by itself a run begins there, wherever the seeker's own start is.
TEST(GuidedEngine, BeginsAtTheStartOfItsSeekerWhereThatIsKept) {
  const OperatingPoint point;
  CurveSeekingSettings s = curve_settings(rough_model(), point);
  s.space.start = scalar_input(-22.0);
  for (const auto& seeking : {GuidedEngine::Seeking(CurveSeeking(s)), GuidedEngine::Seeking(trimmed(-22.0))}) {
    const GuidedEngine plain(seeking, rough_model(), std::nullopt, point);
    EXPECT_NEAR(plain.now().estimate_cad, -1.5, 0.2);
    GuidedEngine kept(seeking, rough_model(), std::nullopt, point, {.keep_start = true});
    const GuidedCycle first = kept.now();
    EXPECT_EQ(first.estimate_cad, -22.0);
    EXPECT_EQ(first.guide_cad, plain.now().guide_cad);
    EXPECT_NEAR(first.feed_forward_cad, plain.now().feed_forward_cad, 1e-12);
    EXPECT_NEAR(first.trim_cad, -22.0 - first.guide_cad, 1e-12);
    kept.at(point);
    EXPECT_NEAR(kept.ask()[0], -22.0, 1.0);  // the dither of extremum seeking
  }
}

// By a curve the guide's optimum is what the seeker believes beforehand: it is the second input, and no jump goes
// there.
TEST(GuidedEngine, WithAKeptStartItIsTheCurveGuidedSeekerItself) {
  const OperatingPoint point;
  CurveSeekingSettings s = curve_settings(rough_model(), point);
  s.space.start = scalar_input(8.0);
  s.rate = 3.0;
  s.limits = {{"p_max_bar", 130.0}};
  double engine::Indicators<double>::* const p_max[] = {&engine::Indicators<double>::p_max_bar};
  const std::vector<double> nodes{-30.0, -5.0, 10.0}, values{220.0, 90.0, 75.0};
  Curve j, drawn[1];
  ASSERT_TRUE(rough_model().tabulate(point, j, p_max, drawn));
  for (const bool with_curves : {false, true}) {
    if (with_curves) s.limit_curves.assign(drawn, drawn + 1);
    CurveSeeking alone(s);
    CurveSeekingSettings elsewhere = s;  // the seeker's own curves are not those of the model
    elsewhere.curve = Curve::parabola(-0.05, 4.0, 40.0);
    if (with_curves) elsewhere.limit_curves = {Curve(nodes, values)};
    GuidedEngine guided(CurveSeeking(elsewhere), rough_model(), std::nullopt, point, {.keep_start = true});
    auto bench = bench_at({{0, point}}, 4);
    double last = 8.0;
    for (int k = 0; k < 60; ++k) {
      guided.at(point);
      const double x = alone.ask()[0];
      ASSERT_EQ(guided.ask()[0], x) << "cycle " << k;
      EXPECT_LE(std::abs(x - last), 3.0 + 1e-12);
      last = x;
      const loop::BenchCycle c = bench.step(x);
      const double components[] = {c.j}, limits[] = {c.indicators.p_max_bar};
      guided.tell({components, limits, c.misfire});
      alone.tell({components, limits, c.misfire});
    }
    EXPECT_LT(guided.estimate()[0], with_curves ? plant_best_cad + 1.5 : 8.0);
  }
}

TEST(GuidedEngine, ASeekerThatHasRunIsNotSentBackToItsStart) {
  const OperatingPoint point;
  auto bench = bench_at({{0, point}}, 4);
  CurveSeeking by_curve = curve_seeking(rough_model(), point);
  auto by_dither = trimmed(-8.0);
  for (int k = 0; k < 60; ++k) {
    const double j[] = {bench.step(by_curve.ask()[0]).j}, same[] = {bench.step(by_dither.ask()[0]).j};
    by_curve.tell({j, {}, false});
    by_dither.tell({same, {}, false});
  }
  for (const auto& seeking : {GuidedEngine::Seeking(by_curve), GuidedEngine::Seeking(by_dither)}) {
    const double learnt = std::visit([](const auto& s) { return s.estimate()[0]; }, seeking);
    const GuidedEngine guided(seeking, rough_model(), std::nullopt, point, {.keep_start = true});
    EXPECT_NEAR(guided.estimate()[0], learnt, 1e-9);
    EXPECT_EQ(guided.protocol().cycle, std::visit([](const auto& s) { return s.protocol().cycle; }, seeking));
  }
}

TEST(GuidedEngine, ANewPointIsReachedAtOnceByWhatWasLearntAtTheOld) {
  OperatingPoint low, high;
  low.fuel_mg = 12.0;
  high.fuel_mg = 30.0;
  auto bench = bench_at({{0, low}, {120, high}}, 1);
  GuidedEngine guided(curve_seeking(rough_model(), low), rough_model(), std::nullopt, low);
  path_of(bench, guided, 120);
  const double learnt = guided.now().trim_cad;
  EXPECT_LT(learnt, -1.0);
  const double plain = guided.now().guide_cad;
  guided.at(high);
  EXPECT_LT(guided.now().guide_cad, plain - 2.0);
  EXPECT_NEAR(guided.now().trim_cad, learnt, 0.05) << "the guide's error of the old point is kept";
}

TEST(GuidedEngine, SmallStepsOfThePointAreNoNewPoint) {
  const OperatingPoint point;
  auto bench = bench_at({{0, point}}, 1);
  GuidedEngine guided(curve_seeking(rough_model(), point), rough_model(), std::nullopt, point);
  path_of(bench, guided, 30);
  const StateColumns before = save_state(guided);
  OperatingPoint drifted = point;
  drifted.fuel_mg *= 1.04;
  EXPECT_EQ(guided.at(drifted), GuideStatus::followed);
  drifted.fuel_mg = point.fuel_mg;
  EXPECT_EQ(guided.at(drifted), GuideStatus::followed);
  EXPECT_EQ(save_state(guided), before);
  drifted.fuel_mg *= 1.04 * 1.04;
  guided.at(drifted);
  EXPECT_NE(save_state(guided), before) << "from where the model was asked last, not from the cycle before";
}

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
  EXPECT_EQ(guided.calibration()->accepted(), 0);
  EXPECT_EQ(guided.recalibrations(), 0);
  EXPECT_NEAR(guided.estimate()[0], plant_best_cad, 1.5) << "the seeker goes on";
}

TEST(GuidedEngine, GoesOnBitForBitFromItsState) {
  OperatingPoint point, other;
  other.fuel_mg = 26.0;
  for (const bool by_curve : {true, false}) {
    const auto make = [&] {
      return GuidedEngine(
          by_curve ? GuidedEngine::Seeking(curve_seeking(rough_model(), point)) : GuidedEngine::Seeking(trimmed()),
          rough_model(), calibration(), point, {.keep_start = true});
    };
    for (const int cut : {0, 1, 45}) {
      auto bench = bench_at({{0, point}, {33, other}}, 1);
      GuidedEngine guided = make();
      path_of(bench, guided, cut);
      GuidedEngine again = make();
      restore_state(again, save_state(guided));
      auto same = bench;
      EXPECT_EQ(path_of(bench, guided, 40), path_of(same, again, 40));
      EXPECT_EQ(save_state(guided), save_state(again));
    }
  }
}

TEST(GuidedEngine, TakesNoMemoryAndNeverThrows) {
  OperatingPoint point, other;
  other.fuel_mg = 26.0;
  auto bench = bench_at({{0, point}, {30, other}}, 1);
  for (const bool by_curve : {true, false}) {
    GuidedEngine guided(
        by_curve ? GuidedEngine::Seeking(curve_seeking(rough_model(), point)) : GuidedEngine::Seeking(trimmed()),
        rough_model(), calibration(), point);
    static_assert(noexcept(guided.at(point)) && noexcept(guided.ask()) && noexcept(guided.tell({}, {})));
    bench.reset(5);
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 60; ++k) {
      guided.at(bench.point());
      const loop::BenchCycle c = bench.step(guided.ask()[0]);
      const double j[] = {c.j};
      guided.tell({j, {}, c.misfire}, bench.pressure().pressure_bar);
    }
    EXPECT_EQ(counter.count(), 0U);
  }
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
