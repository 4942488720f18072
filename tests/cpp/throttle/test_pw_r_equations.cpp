// The equations of the pseudo-Wiener structures in every step, with lags, delay, map and plays by hand.
#include <tuple>

#include "mgdd/common/random.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_pseudo_wiener.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/test.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_pw_r;
using test::asymmetric_throttle;

double draw(std::uint64_t index, double low, double high) {
  return low + (high - low) * random::uniform(17, 3, index);
}

// --- from the first-principle throttle ------------------------------------------------------------------------

TEST(PwRGroups, EachSideHasItsOwnSpring) {
  const Throttle t = asymmetric_throttle();
  const PwR p = pw_r_of(t);
  const double g = 0.35 * (13.3 - 0.6) / (1.7 + 0.22);  // stall torque [N m]
  const double damping = 0.0102 + 0.35 * 0.41 / (1.7 + 0.22);
  const double deg_per_rad = 180.0 / std::numbers::pi;
  for (const auto& [side, preload, spring] : {std::tuple{p.above, 0.31, 0.21}, {p.below, 0.24, 0.33}}) {
    EXPECT_NEAR(side.tau_s, 0.0026 / damping, 1e-12);
    EXPECT_NEAR(side.gain_deg_per_s2_per_duty, deg_per_rad * g / 0.0026, 1e-6);
    EXPECT_NEAR(side.preload_duty, preload / g, 1e-12);
    EXPECT_NEAR(side.spring_duty_per_deg, spring / (deg_per_rad * g), 1e-15);
    EXPECT_NEAR(side.coulomb_duty, 0.17 / g, 1e-12);
    EXPECT_EQ(side.square_per_deg, 0.0);
    EXPECT_EQ(side.cube_per_deg2, 0.0);
  }
  EXPECT_EQ(p.limp_home_deg, 11.0);
  EXPECT_EQ(p.frame.closed_deg, 1.5);
  EXPECT_EQ(p.frame.open_deg, 86.0);
  EXPECT_EQ(p.ramp_deg, 0.4);
}

// --- PW-R -----------------------------------------------------------------------------------------------------

double map_of(const PwRSide& s, double x) {
  return x + s.square_per_deg * x * x + s.cube_per_deg2 * x * x * x;
}

/// Acceleration [deg/s^2] without dry friction if a step of h ended with the speed `next`.
double acceleration(const PwR& p, const PwRState& s, double duty, double next, double h) {
  const bool measured = p.switching == Switching::measured;
  const bool up = measured ? s.above > 0.0 : s.position_deg >= 0.0;
  const PwRSide& side = up ? p.above : p.below;
  const double ramp = s.position_deg / p.ramp_deg;
  const double share = measured ? s.above : std::clamp(ramp, -1.0, 1.0);
  const double slope = measured || std::abs(ramp) > 1.0 ? 0.0 : side.preload_duty / p.ramp_deg;
  const double load = duty - s.bias_duty - side.preload_duty * share - side.spring_duty_per_deg * s.position_deg -
                      (side.spring_duty_per_deg + slope) * h * next;
  return side.gain_deg_per_s2_per_duty * load - next / side.tau_s;
}

TEST(PwREquations, HoldInEveryStepOnBothSides) {
  int holds = 0, slides = 0, ramped = 0, below = 0, stopped = 0;
  for (const Switching switching : {Switching::predicted, Switching::measured}) {
    for (const Friction friction : {Friction::coulomb, Friction::tanh}) {
      PwR p = asymmetric_pw_r();
      p.switching = switching;
      p.friction = friction;
      const double h = p.frame.sample_s / p.frame.substeps;
      p.frame = {.closed_deg = p.frame.closed_deg, .open_deg = p.frame.open_deg, .sample_s = h, .substeps = 1};
      const PwRModel model(p);
      for (std::uint64_t k = 0; k < 4000; ++k) {
        PwRState s = model.at_rest(draw(8 * k, 1.5, 84.0), 0.0);
        if (k % 3 == 0) s.position_deg = draw(8 * k + 1, -1.0, 1.0);
        s.speed_deg_per_s = k % 4 == 0 ? 0.0 : draw(8 * k + 2, -150.0, 150.0);
        s.bias_duty = draw(8 * k + 3, -0.1, 0.1);
        s.above = draw(8 * k + 4, -1.0, 1.0) > 0.0 ? 1.0 : -1.0;
        const double duty = draw(8 * k + 5, -0.5, 0.5);
        const PwRState from = s;
        model.step(s, duty);
        const bool up = switching == Switching::measured ? from.above > 0.0 : from.position_deg >= 0.0;
        const PwRSide& side = up ? p.above : p.below;
        const double most = side.gain_deg_per_s2_per_duty * side.coulomb_duty;
        const auto rest = [&](double next) {  // what is left for friction
          return acceleration(p, from, duty, next, h) - (next - from.speed_deg_per_s) / h;
        };
        const double next = (s.position_deg - from.position_deg) / h;
        if (s.speed_deg_per_s != 0.0) {
          ASSERT_NEAR(next, s.speed_deg_per_s, 1e-6);
        } else if (std::abs(next) > 1e-9) {  // ended at a stop
          ++stopped;
          continue;
        }
        below += up ? 0 : 1;
        ramped += std::abs(from.position_deg) < p.ramp_deg ? 1 : 0;
        if (friction == Friction::tanh) {
          const double t = std::tanh(from.speed_deg_per_s / p.tanh_deg_per_s);
          const double slope = (1.0 - t * t) / p.tanh_deg_per_s;
          ASSERT_NEAR(rest(s.speed_deg_per_s), most * (t + slope * (s.speed_deg_per_s - from.speed_deg_per_s)), 1e-5);
        } else if (std::abs(rest(0.0)) <= most) {
          ++holds;
          ASSERT_EQ(s.speed_deg_per_s, 0.0) << k;
        } else {
          ++slides;
          ASSERT_NEAR(rest(s.speed_deg_per_s), rest(0.0) > 0.0 ? most : -most, 1e-5) << k;
          ASSERT_GT(s.speed_deg_per_s * rest(0.0), 0.0) << k;
        }
      }
    }
  }
  EXPECT_GT(std::min({holds, slides, ramped, below}), 300);
  EXPECT_GT(stopped, 3);
}

TEST(PwREquations, OneSampleIsItsStepsOfTheDelayedDuty) {
  const PwR p = asymmetric_pw_r();
  const PwRModel model(p);
  PwR third = p;
  third.frame.sample_s = p.frame.sample_s / 3.0;
  third.frame.substeps = 1;
  third.frame.delay_samples = 0.0;
  const PwRModel one_step(third);
  PwRState whole = model.at_rest(30.0, 0.05);
  PwRState parts = whole;
  const std::array<double, 6> duty{0.3, -0.2, 0.45, 0.1, -0.4, 0.25};
  const std::array<double, 6> acting{0.05, 0.05, 0.3, -0.2, 0.45, 0.1};
  for (std::size_t k = 0; k < 6; ++k) {
    model.step(whole, duty[k]);
    for (int i = 0; i < 3; ++i)
      one_step.step(parts, acting[k]);
    EXPECT_EQ(whole.position_deg, parts.position_deg) << k;
    EXPECT_EQ(whole.speed_deg_per_s, parts.speed_deg_per_s) << k;
  }
}

TEST(PwREquations, EachSideHasItsOwnMapAndStop) {
  const PwR p = asymmetric_pw_r();
  const PwRModel model(p);
  for (const double x : {-11.0, -4.0, -0.1, 0.0, 0.1, 20.0, 60.0}) {
    PwRState s;
    s.position_deg = x;
    EXPECT_NEAR(model.output(s), 13.0 + map_of(x < 0.0 ? p.below : p.above, x), 1e-12) << x;
    EXPECT_NEAR(model.at_rest(model.output(s), 0.0).position_deg, x, 1e-9) << x;
  }
  PwRState s = model.at_rest(40.0, 0.0);
  for (int k = 0; k < 300; ++k)
    model.step(s, 1.0);
  EXPECT_NEAR(model.output(s), 84.0, 1e-9);
  EXPECT_EQ(s.speed_deg_per_s, 0.0);
  for (int k = 0; k < 300; ++k)
    model.step(s, -1.0);
  EXPECT_NEAR(model.output(s), 1.5, 1e-9);
  EXPECT_EQ(model.at_rest(50.0, 0.2).above, 1.0);
  EXPECT_EQ(model.at_rest(5.0, 0.2).above, -1.0);
}

TEST(PwREquations, ACorrectionPullsEveryStateItsWayAndNoFurtherThanAllowed) {
  const PwR p = asymmetric_pw_r();
  const PwRModel model(p);
  const ObserverGains gains{
      .angle_gain = 0.4, .speed_gain_per_s = 21.0, .bias_gain_duty_per_deg = 0.007, .bias_limit_duty = 0.03};
  for (const double error : {2.0, -3.0}) {
    PwRState s = model.at_rest(40.0, 0.0);
    s.speed_deg_per_s = 5.0;
    s.bias_duty = 0.002;
    const double x = s.position_deg;
    const double target = model.at_rest(40.0 + error, 0.0).position_deg - x;  // error of the position behind the map
    model.correct(s, 40.0 + error, gains);
    EXPECT_NEAR(s.position_deg, x + 0.4 * target, 1e-9);
    EXPECT_NEAR(s.speed_deg_per_s, 5.0 + 21.0 * target, 1e-9);
    EXPECT_NEAR(s.bias_duty, 0.002 - 0.007 * target, 1e-12);
    for (int i = 0; i < 20; ++i) {
      s.position_deg = x;
      model.correct(s, 40.0 + error, gains);
    }
    EXPECT_DOUBLE_EQ(s.bias_duty, error > 0.0 ? -0.03 : 0.03);
  }
  const ObserverGains full{.angle_gain = 1.0};
  PwRState s = model.at_rest(40.0, 0.0);
  model.correct(s, 95.0, full);
  EXPECT_NEAR(model.output(s), 84.0, 1e-9) << "inside the travel";
  model.correct(s, -9.0, full);
  EXPECT_NEAR(model.output(s), 1.5, 1e-9);
  for (const auto& [angle, side] :
       {std::pair{13.46, 1.0}, {13.44, 1.0}, {12.56, 1.0}, {12.54, -1.0}, {13.44, -1.0}, {13.46, 1.0}}) {
    model.correct(s, angle, full);
    EXPECT_EQ(s.above, side) << angle;
  }
}

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
