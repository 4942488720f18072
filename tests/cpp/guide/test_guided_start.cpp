// Where a guided engine begins: at the best of its model, at the start of its seeker, or where that stands.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/guided_engine_case.hpp"

namespace mgdd::guide {
namespace {

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

}  // namespace
}  // namespace mgdd::guide
