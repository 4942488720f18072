// PW-W and PW-P against their equations, written once more, with parameters that differ from their defaults.
#include "support/asymmetric_pseudo_wiener.hpp"
#include "support/test.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_pw_p;
using test::asymmetric_pw_w;

// --- PW-W -----------------------------------------------------------------------------------------------------

TEST(PwWEquations, TheMapIsTheLineThroughItsKnots) {
  const PwW p = asymmetric_pw_w();
  const PwWModel model(p);
  const std::array<double, 7> level{2.5, 3.5, 7.5, 16.5, 46.5, 63.5, 69.5};
  for (std::size_t i = 0; i < 7; ++i)
    EXPECT_NEAR(model.map(-0.27 + 0.13 * static_cast<double>(i)), level[i], 1e-9) << i;
  for (std::size_t i = 0; i + 1 < 7; ++i) {
    EXPECT_NEAR(model.map(-0.27 + 0.13 * (static_cast<double>(i) + 0.3)), level[i] + 0.3 * (level[i + 1] - level[i]),
                1e-9);
  }
  EXPECT_EQ(model.map(-0.9), 2.5);
  EXPECT_NEAR(model.map(0.9), 69.5, 1e-12);
}

TEST(PwWEquations, TwoLagsAndADelayStandBeforeTheMap) {
  const PwW p = asymmetric_pw_w();
  const PwWModel model(p);
  auto s = model.at_rest(20.0, 0.04);
  EXPECT_EQ(s.first_duty, 0.0);  // settled at zero duty
  double first = 0.0, second = 0.0;
  std::vector<double> sent{0.04, 0.04};
  for (int k = 0; k < 400; ++k) {
    const double duty = 0.3 * std::sin(0.05 * k) + 0.1;
    sent.push_back(duty);
    const double acting = sent[sent.size() - 3];
    first += (1.0 - std::exp(-2e-3 / 0.031)) * (acting - first);
    second += (1.0 - std::exp(-2e-3 / 0.11)) * (first - second);
    model.step(s, duty);
    ASSERT_NEAR(s.first_duty, first, 1e-12);
    ASSERT_NEAR(s.second_duty, second, 1e-12);
    ASSERT_NEAR(model.output(s), model.map(second), 1e-9);
  }
}

TEST(PwWEquations, AStartOnTheMapIsTheLowestPlaceWithThatAngle) {
  PwW p = asymmetric_pw_w();
  p.lag_start = LagStart::inverse_map;
  p.rise_deg[2] = 0.0;  // flat at 7.5 deg
  const PwWModel model(p);
  for (const double angle : {3.0, 7.4, 20.0, 45.0, 60.0}) {
    const auto s = model.at_rest(angle, 0.3);
    EXPECT_NEAR(model.map(s.second_duty), angle, 1e-9);
    EXPECT_EQ(s.first_duty, s.second_duty);
    EXPECT_EQ(s.line.before[1], 0.3);
  }
  EXPECT_NEAR(model.at_rest(7.5, 0.0).second_duty, -0.27 + 2.0 * 0.13, 1e-6);
  EXPECT_EQ(model.at_rest(-5.0, 0.0).second_duty, -0.27) << "beyond the map: its end";
  EXPECT_EQ(model.at_rest(99.0, 0.0).second_duty, 0.51);
}

TEST(PwWEquations, ACorrectionMovesTheOffsetByItsShare) {
  const PwWModel w(asymmetric_pw_w());
  auto s = w.at_rest(20.0, 0.0);
  const double before = w.output(s);
  w.correct(s, before + 4.0, {.offset_gain = 0.3});
  EXPECT_NEAR(w.output(s), before + 1.2, 1e-12);
  w.correct(s, before, {.offset_gain = 0.5});
  EXPECT_NEAR(w.output(s), before + 0.6, 1e-12);
  const PwPModel p(asymmetric_pw_p());
  auto q = p.at_rest(20.0, 0.0);
  EXPECT_NEAR(p.output(q), 13.0 + 3.0, 1e-12);
  p.correct(q, 20.0, {.offset_gain = 0.3});
  EXPECT_NEAR(p.output(q), 16.0 + 1.2, 1e-12);
}

// --- PW-P -----------------------------------------------------------------------------------------------------

TEST(PwPEquations, PlaysAddUpBehindTheLags) {
  const PwP p = asymmetric_pw_p();
  const PwPModel model(p);
  auto s = model.at_rest(20.0, 0.04);
  double first = 0.0, second = 0.0;
  std::array<double, 3> played{};
  std::vector<double> sent{0.04, 0.04};
  bool at_stop = false;
  for (int k = 0; k < 800; ++k) {
    const double duty = 0.9 * std::sin(0.02 * k) + 0.05;
    sent.push_back(duty);
    first += (1.0 - std::exp(-2e-3 / 0.031)) * (sent[sent.size() - 3] - first);
    second += (1.0 - std::exp(-2e-3 / 0.11)) * (first - second);
    double angle = 13.0 + 3.0;
    for (std::size_t i = 0; i < 3; ++i) {
      played[i] = std::clamp(played[i], second - p.radius_duty[i], second + p.radius_duty[i]);
      angle += p.gain_deg_per_duty[i] * played[i];
    }
    model.step(s, duty);
    ASSERT_NEAR(model.output(s), std::clamp(angle, 1.5, 84.0), 1e-9) << k;
    at_stop = at_stop || angle < 1.5 || angle > 84.0;
  }
  EXPECT_TRUE(at_stop);
}

TEST(PwPEquations, AStartOnTheMapIsInTheMiddleOfEveryGap) {
  PwP p = asymmetric_pw_p();
  p.lag_start = LagStart::inverse_map;
  const PwPModel model(p);
  for (const double angle : {5.0, 16.0, 60.0}) {
    const auto s = model.at_rest(angle, 0.3);
    const double place = (angle - 13.0 - 3.0) / (90.0 + 60.0 + 35.0);
    EXPECT_NEAR(s.second_duty, place, 1e-12);
    EXPECT_EQ(s.first_duty, s.second_duty);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(s.play_duty[i], s.second_duty);
    EXPECT_NEAR(model.output(s), angle, 1e-9);
  }
  p.gain_deg_per_duty = {40.0, 10.0, 5.0};
  EXPECT_EQ(PwPModel(p).at_rest(84.0, 0.0).second_duty, 1.0) << "no duty beyond one";
  EXPECT_EQ(PwPModel(p).at_rest(-84.0, 0.0).second_duty, -1.0);
}

}  // namespace
}  // namespace mgdd::throttle
