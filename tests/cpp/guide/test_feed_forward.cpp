// Feed-forward of a guide, also from the model of an engine.
#include "mgdd/guide/feed_forward.hpp"
#include "mgdd/guide/guided_engine.hpp"
#include "mgdd/optimize/ask_tell/variant_seeker.hpp"
#include "support/guided_case.hpp"
#include "support/guided_engine_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(FeedForward, ALittleTrustedGuideIsInForceInPart) {
  FeedForward<ExtremumSeeking> seeker = guided(-20.0, {.initial = 0.25, .noise_sd = 0.25});
  seeker.offer(at(-4.0), GuideCause::calibration);
  EXPECT_EQ(seeker.estimate()[0], -20.0);
  EXPECT_NEAR(seeker.path().feed_forward()[0], -16.0, 1e-12);
}

// The guide is 1.5 CAD late everywhere: the trim takes that, and a step moves the estimate as far as the optimum goes.
TEST(FeedForward, ANewPointMovesTheEstimateAndKeepsTheTrim) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-2.7), GuideCause::new_point);
  run(seeker, -4.2, 600);
  const double trim = seeker.trim()[0];
  EXPECT_NEAR(trim, -1.5, 0.02);
  seeker.offer(at(-9.2), GuideCause::new_point);
  const std::vector<double> applied = run(seeker, -10.7, 2);
  EXPECT_NEAR(applied[0], -4.2, 0.02);   // the test of the guide: the old place, without dither ...
  EXPECT_NEAR(applied[1], -10.7, 0.02);  // ... and the new one
  EXPECT_EQ(seeker.path().trust().verdict(), Verdict::confirmed);
  EXPECT_NEAR(seeker.estimate()[0], -10.7, 0.05);
  EXPECT_NEAR(seeker.trim()[0], trim, 1e-12);
}

TEST(FeedForward, WhatIsLeftOfACalibrationBelongsToTheOldPoint) {
  FeedForward<ExtremumSeeking> seeker = guided();
  seeker.offer(at(-1.0), GuideCause::new_point);
  run(seeker, -1.0, 300);
  seeker.offer(at(-4.0), GuideCause::calibration);
  seeker.offer(at(-7.0), GuideCause::new_point);  // by the new model the optimum moves by 3 CAD, not by 6
  run(seeker, -4.0, 2);
  EXPECT_NEAR(seeker.estimate()[0], -4.0, 0.1);
  EXPECT_NEAR(seeker.path().feed_forward()[0], -7.0, 0.1);
}

TEST(FeedForward, FollowsAPointThatDriftsThroughAFilterWithoutATestOrARestart) {
  FeedForward<ExtremumSeeking> plain = guided(), drifting = guided();
  for (FeedForward<ExtremumSeeking>* one : {&plain, &drifting}) {
    one->offer(at(-4.0), GuideCause::new_point);
    run(*one, -4.0, 45);
  }
  drifting.offer(at(-4.3), GuideCause::following);
  double left = 0.3;
  for (int k = 0; k < 120; ++k) {
    left *= 0.8;
    const double shift = -(0.3 - left);
    drifting.ask();
    EXPECT_NEAR(drifting.path().feed_forward()[0], -4.0 + shift, 1e-8);
    const double x = plain.ask()[0];
    EXPECT_NEAR(drifting.ask()[0], x + shift, 1e-8);  // asking again moves nothing
    const double j[] = {quadratic(x + 4.0)};
    plain.tell({j, {}, false});
    drifting.tell({j, {}, false});
    EXPECT_FALSE(drifting.path().testing());
  }
  EXPECT_EQ(drifting.path().feed_forward()[0], -4.3);
  EXPECT_EQ(save_state(drifting.seeker()).at("seen"), save_state(plain.seeker()).at("seen"));
  drifting.offer(at(-4.6), GuideCause::following);
  run(drifting, -4.3, 1);
  drifting.offer(at(-9.0), GuideCause::new_point);  // what was not yet followed belongs to the move
  const double before = drifting.estimate()[0];
  run(drifting, before - 4.64, 2);
  EXPECT_NEAR(drifting.estimate()[0] - before, -(9.0 - 4.36), 0.1);
}

TEST(FeedForward, AskTellAndOfferAreNoexceptAndDoNotAllocate) {
  for (auto& [name, any] : every_seeker(space_at(scalar_input(8.0), 40.0), 0.25, 3)) {
    SCOPED_TRACE(name);
    FeedForward<VariantSeeker> seeker{VariantSeeker(any)};
    const GuideValue one = at(2.0), other = at(-6.0), bad = at(nan);
    static_assert(noexcept(seeker.ask()) && noexcept(seeker.restart()) &&
                  noexcept(seeker.tell(std::declval<const Reading&>())) &&
                  noexcept(seeker.offer(one, GuideCause::new_point)));
    static_assert(AnySeeker<FeedForward<VariantSeeker>>);
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 600; ++k) {
      if (k % 60 == 0) seeker.offer(k % 120 == 0 ? one : other, GuideCause::new_point);
      if (k % 60 == 30) seeker.offer(k % 120 == 30 ? bad : other, GuideCause::calibration);
      const double j[] = {quadratic(seeker.ask()[0]) + 0.1 * std::sin(k)};
      seeker.tell({j, {}, k % 50 == 7});
    }
    EXPECT_EQ(counter.count(), 0u);
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
