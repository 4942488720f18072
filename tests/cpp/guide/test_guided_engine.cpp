// The guided loop on the virtual bench: calibration without a jump, new points, points without a guide, a kept start,
// real time.
#include "mgdd/guide/guided_engine.hpp"

#include <cmath>

#include "support/guided_engine_case.hpp"

namespace mgdd::guide {
namespace {

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
  drifted.speed_rpm = std::nan("");
  EXPECT_EQ(guided.at(drifted), GuideStatus::refused);
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

// The model's best timing of the second point lies below the bounds: the seeker begins anew there, once, and goes on.
template <class Alone>
void expect_to_wait_out_of_bounds(Alone alone, GuidedEngine guided, const OperatingPoint& high, int cycles) {
  auto bench = bench_at({{0, {}}, {40, high}}, 4);
  for (int k = 0; k < cycles; ++k) {
    EXPECT_EQ(guided.at(bench.point()), k < 40 ? GuideStatus::followed : GuideStatus::refused);
    if (k == 40) alone.restart();
    const double x = alone.ask()[0];
    ASSERT_EQ(guided.ask()[0], x) << "cycle " << k;
    const loop::BenchCycle c = bench.step(x);
    const double j[] = {c.j};
    guided.tell({j, {}, c.misfire});
    alone.tell({j, {}, c.misfire});
  }
  EXPECT_LT(guided.estimate()[0], alone.settings().space.lower[0] + 2.5) << "the plant's best lies below them too";
}

TEST(GuidedEngine, AGuideOutOfTheBoundsIsWaitedForWhileTheSeekerLearns) {
  OperatingPoint low, high;
  high.fuel_mg = 34.0;
  const double edge = 0.5 * (rough_model().find(low).soc_cad + rough_model().find(high).soc_cad);
  CurveSeekingSettings by_curve = curve_settings(rough_model(), low);
  by_curve.space.lower = scalar_input(edge);
  const CurveSeeking seeking(by_curve);
  expect_to_wait_out_of_bounds(seeking, GuidedEngine(seeking, rough_model(), std::nullopt, low), high, 120);
  optimize::ExtremumSeekingSettings s;
  s.space = {scalar_input(4.0), scalar_input(edge), scalar_input(10.0), {}};
  s.dither.amplitude = scalar_input(1.0);
  const optimize::ExtremumSeeking plain(s);
  expect_to_wait_out_of_bounds(
      plain,
      GuidedEngine(FeedForward{optimize::VariantSeeker(plain)}, rough_model(), std::nullopt, low, {.keep_start = true}),
      high, 300);
}

}  // namespace
}  // namespace mgdd::guide
