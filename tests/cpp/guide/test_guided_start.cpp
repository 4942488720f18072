// Where a guided engine begins: at the best of its model, at the start of its seeker, or where that stands.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/guided_engine_case.hpp"

namespace mgdd::guide {
namespace {

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

}  // namespace
}  // namespace mgdd::guide
