// Pseudo-Wiener models: transfer function, first-principle groups, friction, play, sensitivities, lanes, real time.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "mgdd/dynamics/predict.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "support/no_alloc.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::throttle {
namespace {

using test_support::AllocationCounter;
using test_support::Signal;

PwR linear_model() {
  PwR p;
  for (PwRSide* s : {&p.above, &p.below}) {
    s->preload_duty = 0.0;
    s->coulomb_duty = 0.0;
  }
  p.frame.substeps = 1;
  return p;
}

template <class P>
Signal run(const P& p, const Signal& duty, double start_deg) {
  const auto model = model_of(p);
  auto state = model.at_rest(start_deg, 0.0);
  Signal y(duty.size());
  dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(y));
  return y;
}

TEST(PseudoWienerPwR, WithoutFrictionAndPreloadItIsTheSecondOrderTransferFunction) {
  const PwR p = linear_model();
  const double t = p.frame.sample_s;
  const PwRSide& s = p.above;
  const double d = 1.0 + t / s.tau_s + t * t * s.gain_deg_per_s2_per_duty * s.spring_duty_per_deg;
  const double a1 = 1.0 + (1.0 - t * t * s.gain_deg_per_s2_per_duty * s.spring_duty_per_deg) / d;
  const double a2 = -1.0 / d;
  const double b1 = t * t * s.gain_deg_per_s2_per_duty / d;
  EXPECT_NEAR(b1 / (1.0 - a1 - a2), 1.0 / s.spring_duty_per_deg, 1e-6 / s.spring_duty_per_deg);  // DC gain
  const Signal duty = test_support::chirp(0.02, 0.01, 1.0, 20.0, 2.0);
  const Signal y = run(p, duty, 8.0);
  double x1 = 0.0;
  double x2 = 0.0;  // x(k-1), x(k-2), from limp-home
  for (std::size_t k = 1; k < y.size(); ++k) {
    const double x = a1 * x1 + a2 * x2 + b1 * duty[k - 1];
    ASSERT_NEAR(y[k] - 8.0, x, 1e-9) << k;
    x2 = x1;
    x1 = x;
  }
  EXPECT_GT(y.back(), 9.0);
}

TEST(PseudoWienerPwR, GroupsOfP1) {
  const PwR p = pw_r_of(Throttle{});
  EXPECT_NEAR(p.above.tau_s, 0.0197, 5e-5);
  EXPECT_NEAR(p.above.gain_deg_per_s2_per_duty, 83597.0, 1.0);
  EXPECT_NEAR(p.above.preload_duty, 0.1292, 5e-5);
  EXPECT_NEAR(p.above.spring_duty_per_deg, 4.96e-4, 1e-6);
  EXPECT_NEAR(p.above.coulomb_duty, 0.0927, 5e-5);
  EXPECT_EQ(p.above, p.below);
  EXPECT_NO_THROW(p.validate());
}

TEST(PseudoWienerPwR, MapsOneToOneToTheFirstPrinciplePlant) {
  Throttle t;  // Coulomb friction
  t.inductance_mh = 0.0;
  const Signal duty = test_support::chirp(0.15, 0.20, 0.2, 6.0, 4.0);
  PwR p = pw_r_of(t);
  p.frame.substeps = 10;  // the plant's own step
  Signal plant(duty.size());
  auto state = at_rest(8.0);
  simulate(ThrottlePlant(t), {.duty = duty}, 10, state, {.angle_deg = plant});
  const Signal model = run(p, duty, 8.0);
  double worst = 0.0;
  for (std::size_t k = 0; k < duty.size(); ++k)
    worst = std::max(worst, std::abs(plant[k] - model[k]));
  EXPECT_LT(worst, 1e-6);  // the chirp stays off the soft stops
}

TEST(PseudoWienerPwR, SetValuedFrictionSticksExactlyAndTheSmoothOneCreepsAsStated) {
  PwR p;
  const double share = 0.5;
  const double hold = p.above.preload_duty + p.above.spring_duty_per_deg * 32.0 + share * p.above.coulomb_duty;
  const Signal duty(1000, hold);
  EXPECT_EQ(run(p, duty, 40.0).back(), 40.0);
  p.friction = Friction::tanh;
  for (PwRSide* s : {&p.above, &p.below})
    s->spring_duty_per_deg = 1e-5;  // so that the spring takes nothing back on the way
  const Signal weak(1000, p.above.preload_duty + 1e-5 * 32.0 + share * p.above.coulomb_duty);
  const Signal y = run(p, weak, 40.0);
  const double creep = (y[400] - y[200]) / 0.2;
  const double viscous = creep / (p.above.tau_s * p.above.gain_deg_per_s2_per_duty * p.above.coulomb_duty);
  EXPECT_NEAR(creep, p.tanh_deg_per_s * std::atanh(share - viscous), 0.05);
  EXPECT_LT(creep, p.tanh_deg_per_s * std::atanh(share));
}

TEST(PseudoWienerPwR, StaysInsideTheTravelAndReleasesAtOnce) {
  const PwR p;
  Signal duty(600, 1.0);
  std::fill(duty.begin() + 300, duty.end(), -1.0);
  const Signal y = run(p, duty, 8.0);
  EXPECT_EQ(*std::max_element(y.begin(), y.end()), 90.0);
  EXPECT_EQ(*std::min_element(y.begin(), y.end()), 0.0);
  EXPECT_LT(y[330], 80.0);
}

TEST(PseudoWienerPwR, TheStaticMapAndItsInverseAgree) {
  PwR p;
  p.above.square_per_deg = 2e-3;
  p.above.cube_per_deg2 = -2e-5;
  p.below.square_per_deg = 4e-3;
  p.validate();
  const PwRModel model(p);
  for (double angle = 0.0; angle <= 90.0; angle += 1.5)
    EXPECT_NEAR(model.output(model.at_rest(angle, 0.0)), angle, 1e-9);
}

TEST(PseudoWienerPwR, DelayShiftsTheDuty) {
  PwR p;
  const Signal duty = test_support::chirp(0.15, 0.2, 1.0, 6.0, 1.0);
  const Signal now = run(p, duty, 8.0);
  p.frame.delay_samples = 3;
  const Signal late = run(p, duty, 8.0);
  for (std::size_t k = 3; k < duty.size(); ++k)
    ASSERT_EQ(late[k], now[k - 3]);
}

TEST(PseudoWienerPwR, AnImpossibleDelayIsRefusedByTheModelItself) {
  PwR p;
  p.frame.delay_samples = 50.0;
  EXPECT_THROW(static_cast<void>(PwRModel(p)), ParameterError);
  EXPECT_THROW(static_cast<void>(model_of(lift<Dual<3>>(p))), ParameterError);
  EXPECT_THROW(static_cast<void>(prepare(p)), ParameterError);
  PwW w;
  w.frame.delay_samples = -1.0;
  EXPECT_THROW(static_cast<void>(PwWModel(w)), ParameterError);
  PwP many;
  many.plays = 9;
  EXPECT_THROW(static_cast<void>(PwPModel(many)), ParameterError);
}

TEST(PseudoWienerPwR, ADelayKeepsItsTimeWhenTheSampleTimeChanges) {
  PwR p;
  p.frame.delay_samples = 3.0;
  EXPECT_DOUBLE_EQ(p.frame.at_sample(2e-3).delay_samples, 1.5);
  p.frame.delay_samples = 1.0;
  EXPECT_DOUBLE_EQ(p.frame.at_sample(2e-3).delay_samples, 0.5);
  EXPECT_EQ(p.frame.at_sample(5e-4).delay_samples, 2.0);
  p.frame.delay_samples = 4.0;
  try {
    static_cast<void>(p.frame.at_sample(5e-4));
    FAIL();
  } catch (const ParameterError& error) {
    EXPECT_EQ(
        std::string(error.what()),
        "delay_samples = 8 at sample_s = 0.0005 s: must be in [0, 5]; for a delay of 4 ms take sample_s >= 0.0008 s");
  }
}

TEST(PseudoWienerPwR, AFractionalDelayActsWithTheMeanOfTwoDuties) {
  PwR p;
  const Signal duty = test_support::chirp(0.15, 0.2, 1.0, 6.0, 1.0);
  p.frame.delay_samples = 2.25;
  const Signal late = run(p, duty, 8.0);
  p.frame.delay_samples = 0.0;
  Signal mixed(duty.size(), 0.0);
  const auto at = [&](std::size_t k, std::size_t ago) { return k >= ago ? duty[k - ago] : 0.0; };
  for (std::size_t k = 0; k < duty.size(); ++k)
    mixed[k] = at(k, 2) + 0.25 * (at(k, 3) - at(k, 2));
  EXPECT_EQ(late, run(p, mixed, 8.0));
}

TEST(PseudoWienerPwR, MeasuredSwitchingKeepsItsSideInsideTheDeadBandAndHandsOverWithoutABump) {
  PwR p;
  p.switching = Switching::measured;
  p.below.square_per_deg = 4e-3;
  const PwRModel model(p);
  PwRState s = model.at_rest(12.0, 0.0);
  s.bias_duty = 0.05;
  const ObserverGains reset{.angle_gain = 1.0, .speed_gain_per_s = 0.0, .bias_gain_duty_per_deg = 0.0};
  model.correct(s, 7.8, reset);
  EXPECT_EQ(s.above, 1.0);
  model.correct(s, 7.6, reset);
  EXPECT_EQ(s.above, -1.0);
  EXPECT_NEAR(model.output(s), 7.6, 1e-9);
  EXPECT_EQ(s.bias_duty, 0.05);
  model.correct(s, 8.2, reset);
  EXPECT_EQ(s.above, -1.0);
  model.correct(s, 8.4, reset);
  EXPECT_EQ(s.above, 1.0);
}

TEST(PseudoWienerPwR, CorrectionFollowsTheStatedGains) {
  const PwRModel model{PwR{}};
  PwRState s = model.at_rest(40.0, 0.0);
  model.correct(s, 41.0, {});
  EXPECT_DOUBLE_EQ(model.output(s), 40.35);
  EXPECT_DOUBLE_EQ(s.speed_deg_per_s, 35.0);
  EXPECT_DOUBLE_EQ(s.bias_duty, -0.004);
  for (int i = 0; i < 1000; ++i) {
    s.position_deg = 0.0;
    model.correct(s, 60.0, {});
  }
  EXPECT_DOUBLE_EQ(s.bias_duty, -0.4);
}

// --- play -----------------------------------------------------------------------------------------------------

Signal played(const Signal& x, double radius) {
  Signal out;
  double p = 0.0;
  for (const double v : x)
    out.push_back(p = dynamics::play(v, radius, p));
  return out;
}

TEST(Play, IsRateIndependent) {
  std::mt19937 bits(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Signal corners(40);
  for (double& c : corners)
    c = uniform(bits);
  Signal slow;
  std::vector<std::size_t> at;  // where a corner is reached
  for (std::size_t i = 1; i < corners.size(); ++i) {
    const std::size_t pieces = 1 + i % 7;
    for (std::size_t j = 1; j < pieces; ++j)
      slow.push_back(corners[i - 1] + (corners[i] - corners[i - 1]) * double(j) / double(pieces));
    slow.push_back(corners[i]);
    at.push_back(slow.size() - 1);
  }
  const Signal fast = played(Signal(corners.begin() + 1, corners.end()), 0.2);
  const Signal warped = played(slow, 0.2);
  for (std::size_t i = 0; i < fast.size(); ++i)
    ASSERT_NEAR(warped[at[i]], fast[i], 1e-12);
}

TEST(Play, WipesOutInnerLoopsAndIsTwoRadiiWide) {
  const double r = 0.1;
  const Signal with = played({0.0, 1.0, 0.3, 0.6, 0.4, 0.55, 1.2, -1.0}, r);
  const Signal without = played({0.0, 1.2, -1.0}, r);
  EXPECT_NEAR(with.back(), without.back(), 1e-12);
  EXPECT_NEAR(with[6], without[1], 1e-12);
  // Up and down through one input: the outputs differ by the width of the gap.
  const Signal loop = played({0.0, 1.0, 0.5, -1.0, 0.5}, r);
  EXPECT_NEAR(loop[2] - loop[4], 2.0 * r, 1e-12);
  EXPECT_NEAR(played({0.0, 1.0, 0.81}, r).back(), 0.9, 1e-12);  // rests inside the gap
}

// --- sensitivities, lanes, real time --------------------------------------------------------------------------

PwW some_pw_w() {
  PwW p;
  p.first_s = 0.02;
  p.second_s = 0.2;
  p.base_deg = 1.0;
  p.rise_deg = {2.0, 5.0, 20.0, 25.0, 15.0, 10.0};
  return p;
}
PwP some_pw_p(int plays = 1) {
  PwP p;
  p.first_s = 0.02;
  p.second_s = 0.2;
  p.plays = plays;
  for (std::size_t i = 0; i < static_cast<std::size_t>(plays); ++i) {
    p.radius_duty[i] = 0.02 + 0.01 * double(i);
    p.gain_deg_per_duty[i] = 200.0 / plays;
  }
  return p;
}
PwR smooth_pw_r() {
  PwR p;
  p.friction = Friction::tanh;
  return p;
}

template <class P>
void expect_exact_move_slopes(const P& p) {
  const auto model = model_of(p);
  auto state = model.at_rest(30.0, 0.2);
  for (int i = 0; i < 50; ++i)
    model.step(state, 0.3);
  const std::array<double, 3> moves{0.35, 0.1, 0.3};
  const std::array<int, 3> lengths{8, 12, 20};
  std::vector<double> y(40), up(40), down(40);
  std::vector<std::array<double, 3>> slope(40), ignored(40);
  dynamics::predict<3>(model, state, moves, lengths, y, slope);
  for (std::size_t m = 0; m < 3; ++m) {
    auto plus = moves;
    auto minus = moves;
    plus[m] += 1e-6;
    minus[m] -= 1e-6;
    dynamics::predict<3>(model, state, plus, lengths, up, ignored);
    dynamics::predict<3>(model, state, minus, lengths, down, ignored);
    for (std::size_t k = 0; k < 40; ++k)
      ASSERT_NEAR(slope[k][m], (up[k] - down[k]) / 2e-6, 1e-4 * (1.0 + std::abs(slope[k][m]))) << m << " " << k;
  }
  EXPECT_GT(std::abs(slope[39][0]), 0.0);
}

TEST(PseudoWienerPrediction, SlopesAlongTheMovesAreExact) {
  expect_exact_move_slopes(PwR{});
  expect_exact_move_slopes(smooth_pw_r());
  expect_exact_move_slopes(some_pw_w());
  expect_exact_move_slopes(some_pw_p());
  expect_exact_move_slopes(some_pw_p(8));
}

template <class P>
void expect_exact_parameter_slopes(const P& p, std::size_t number, double step) {
  const Signal duty = test_support::chirp(0.2, 0.15, 1.0, 5.0, 0.4);
  auto seeded = lift<Dual<1>>(p);
  numbers(seeded)[number]->grad[0] = 1.0;
  const auto model = model_of(seeded);
  auto state = model.at_rest(Dual<1>(20.0), Dual<1>(0.0));
  std::vector<Dual<1>> y(duty.size());
  dynamics::simulate(model, state, std::span<const double>(duty), std::span<Dual<1>>(y));
  P up = p;
  P down = p;
  *numbers(up)[number] += step;
  *numbers(down)[number] -= step;
  const Signal high = run(up, duty, 20.0);
  const Signal low = run(down, duty, 20.0);
  double scale = 0.0;
  for (const auto& v : y)
    scale = std::max(scale, std::abs(v.grad[0]));
  for (std::size_t k = 0; k < y.size(); ++k)
    ASSERT_NEAR(y[k].grad[0], (high[k] - low[k]) / (2.0 * step), 1e-4 * (scale + 1e-9)) << number << " at " << k;
}

TEST(PseudoWienerPrediction, SlopesAlongTheParametersAreExact) {
  for (const std::size_t number : {0u, 1u, 2u, 3u, 4u, 5u, 6u, 14u}) {
    const double size = std::abs(*numbers(smooth_pw_r())[number]);
    expect_exact_parameter_slopes(smooth_pw_r(), number, size > 0.0 ? 1e-6 * size : 1e-9);
  }
  for (std::size_t number = 0; number < 9; ++number)
    expect_exact_parameter_slopes(some_pw_w(), number, 1e-6 * std::abs(*numbers(some_pw_w())[number]));
  for (std::size_t number = 0; number < 5; ++number)
    expect_exact_parameter_slopes(some_pw_p(), number, 1e-7);
}

template <class P>
void expect_equal_lanes(const P& p) {
  using L = Lanes<4>;
  std::array<P, 4> each;
  auto lanes = lift<L>(p);
  for (std::size_t i = 0; i < 4; ++i) {
    each[i] = p;
    for (std::size_t n = 0; n < 2; ++n) {
      *numbers(each[i])[n] *= 1.0 + 0.1 * double(i);
      numbers(lanes)[n]->set(static_cast<int>(i), *numbers(each[i])[n]);
    }
  }
  const Signal duty = test_support::chirp(0.1, 0.3, 1.0, 8.0, 0.5);
  const auto model = model_of(lanes);
  auto state = model.at_rest(L(20.0), L(0.0));
  std::array<Signal, 4> plain;
  for (std::size_t i = 0; i < 4; ++i)
    plain[i] = run(each[i], duty, 20.0);
  for (std::size_t k = 0; k < duty.size(); ++k) {
    const L y = model.output(state);
    for (std::size_t i = 0; i < 4; ++i)
      ASSERT_EQ(y[static_cast<int>(i)], plain[i][k]) << k;
    model.step(state, L(duty[k]));
  }
}

TEST(PseudoWienerLanes, HoldTheBitsOfThePlainCode) {
  expect_equal_lanes(PwR{});
  expect_equal_lanes(smooth_pw_r());
  expect_equal_lanes(some_pw_w());
  expect_equal_lanes(some_pw_p(4));
}

template <class M>
constexpr bool cannot_throw =
    noexcept(std::declval<const M&>().step(std::declval<typename M::State&>(), std::declval<M>().output({}))) &&
    noexcept(std::declval<const M&>().output(std::declval<const typename M::State&>()));
static_assert(cannot_throw<PwRModel> && cannot_throw<PwWModel> && cannot_throw<PwPModel>);
static_assert(cannot_throw<BasicPwRModel<Dual<5>>> && cannot_throw<BasicPwWModel<Dual<5>>> &&
              cannot_throw<BasicPwPModel<Dual<5>>>);
static_assert(cannot_throw<BasicPwRModel<Lanes<4>>>);

template <class T, class P>
std::size_t allocations(const P& p) {
  const AllocationCounter counter;
  const auto model = model_of(lift<T>(p));
  auto state = model.at_rest(T(20.0), T(0.1));
  for (int k = 0; k < 50; ++k) {
    model.step(state, T(0.3));
    model.correct(state, T(21.0), {});
  }
  volatile double sink = 0.0;  // NOLINT(misc-const-correctness): written on double
  if constexpr (std::is_same_v<T, double>) sink = model.output(state);
  static_cast<void>(sink);
  return counter.count();
}

TEST(PseudoWienerRealTime, NothingIsAllocatedInAnyKindAndOption) {
  int variants = 0;
  const auto count = [&](const auto& p) {
    EXPECT_EQ((allocations<double>(p)), 0u);
    EXPECT_EQ((allocations<Dual<5>>(p)), 0u);
    EXPECT_EQ((allocations<Lanes<4>>(p)), 0u);
    ++variants;
  };
  for (const double delay : {0.0, 2.5, 5.0}) {
    for (const auto friction : {Friction::coulomb, Friction::tanh}) {
      for (const auto switching : {Switching::predicted, Switching::measured}) {
        PwR p;
        p.frame.delay_samples = delay;
        p.friction = friction;
        p.switching = switching;
        count(p);
      }
    }
    for (const auto start : {LagStart::rest, LagStart::inverse_map}) {
      PwW w = some_pw_w();
      w.frame.delay_samples = delay;
      w.lag_start = start;
      count(w);
      for (const int plays : {1, 8}) {
        PwP p = some_pw_p(plays);
        p.frame.delay_samples = delay;
        p.lag_start = start;
        count(p);
      }
    }
  }
  EXPECT_EQ(variants, 30);
}

// --- the others -----------------------------------------------------------------------------------------------

TEST(PseudoWienerStart, TheInverseMapGivesTheAngle) {
  PwW w = some_pw_w();
  w.lag_start = LagStart::inverse_map;
  PwP p = some_pw_p(4);
  p.lag_start = LagStart::inverse_map;
  for (const double angle : {9.0, 30.0, 60.0}) {
    EXPECT_NEAR(PwWModel(w).output(PwWModel(w).at_rest(angle, 0.0)), angle, 1e-9);
    EXPECT_NEAR(PwPModel(p).output(PwPModel(p).at_rest(angle, 0.0)), angle, 1e-9);
  }
}

TEST(PseudoWienerStart, AFullOffsetGainGivesMeasuredPlusTheSimulatedDifference) {
  const PwWModel model(some_pw_w());
  auto free = model.at_rest(20.0, 0.0);
  auto corrected = free;
  for (int k = 0; k < 100; ++k) {
    model.step(free, 0.4);
    model.step(corrected, 0.4);
  }
  const double before = model.output(free);
  model.correct(corrected, 33.0, {});
  for (int k = 0; k < 20; ++k) {
    model.step(free, 0.1);
    model.step(corrected, 0.1);
  }
  EXPECT_NEAR(model.output(corrected), 33.0 + model.output(free) - before, 1e-12);
}

TEST(PseudoWienerChecks, NameFieldValueAndBound) {
  const auto message = [](const PseudoWiener& p) -> std::string {
    try {
      validate(p);
    } catch (const ParameterError& error) {
      return error.what();
    }
    return "";
  };
  PwR r;
  EXPECT_EQ(message(r), "");
  r.above.tau_s = -1.0;
  EXPECT_EQ(message(r), "above_tau_s = -1 s: must be in [0.005, 0.3]");
  r = {};
  r.above.square_per_deg = -4e-3;
  EXPECT_EQ(message(r), "");
  r.above.cube_per_deg2 = -5e-5;
  EXPECT_NE(message(r).find("must stay >= 0.2"), std::string::npos);
  PwP p = some_pw_p();
  p.plays = 9;
  EXPECT_EQ(message(p), "plays = 9: must be in [1, 8]");
  PwW w = some_pw_w();
  w.rise_deg[2] = -1.0;
  EXPECT_EQ(message(w), "rise_3_deg = -1 deg: must be in [0, 5000]");
  w = some_pw_w();
  w.frame.delay_samples = 6.0;
  EXPECT_EQ(message(w), "delay_samples = 6: must be in [0, 5]");
}

}  // namespace
}  // namespace mgdd::throttle
