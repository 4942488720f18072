// The whole guided loop on the virtual bench: arrival, new points, calibration without a jump, state, real time.
#include "mgdd/guide/guided_engine.hpp"

#include <cmath>
#include <vector>

#include "support/guided_engine_case.hpp"

namespace mgdd::guide {
namespace {

TEST(GuidedEngine, TheModelLearnsWhileTheEngineSeeks) {
  const OperatingPoint point;
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    auto bench = bench_at({{0, point}}, seed);
    GuidedEngine guided(curve_seeking(rough_model(), point), rough_model(), calibration(), point);
    EXPECT_NEAR(guided.now().guide_cad, -1.5, 0.2);
    const std::vector<double> path = path_of(bench, guided, 60);
    EXPECT_NEAR(guided.calibration().value().cylinder().wall_heat.wall_heat_scale, 0.5, 0.025);
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

}  // namespace
}  // namespace mgdd::guide
