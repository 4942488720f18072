// Pseudo-Wiener models: settings, delays, sensitivities, lanes. Their equations stand in test_pw_*_equations.cpp.
#include "mgdd/common/error.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "support/asymmetric_pseudo_wiener.hpp"
#include "support/test.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::throttle {
namespace {

using test_support::Signal;

template <class P>
Signal run(const P& p, const Signal& duty, double start_deg) {
  const auto model = model_of(p);
  auto state = model.at_rest(start_deg, 0.0);
  Signal y(duty.size());
  dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(y));
  return y;
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

using test::asymmetric_pw_p;
using test::asymmetric_pw_r;
using test::asymmetric_pw_w;

TEST(PseudoWienerNumbers, SettingsOutsideTheirBoundsAreNamed) {
  const auto refused = [](auto good, auto change, const std::string& part) {
    EXPECT_NO_THROW(good.validate());
    change(good);
    try {
      good.validate();
      ADD_FAILURE() << part;
    } catch (const ParameterError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  const PwR r = asymmetric_pw_r();
  refused(r, [](PwR& p) { p.limp_home_deg = 1.0; }, "limp_home_deg = 1 deg");
  refused(r, [](PwR& p) { p.limp_home_deg = 85.0; }, "limp_home_deg = 85 deg");
  refused(r, [](PwR& p) { p.frame.open_deg = 10.0, p.frame.closed_deg = 10.0; }, "must be above closed_deg");
  refused(r, [](PwR& p) { p.frame.sample_s = 0.2; }, "sample_s = 0.2");
  refused(r, [](PwR& p) { p.frame.substeps = 0; }, "substeps = 0");
  refused(r, [](PwR& p) { p.frame.delay_samples = -1; }, "delay_samples = -1");
  refused(r, [](PwR& p) { p.ramp_deg = 0.0; }, "ramp_deg = 0");
  refused(r, [](PwR& p) { p.tanh_deg_per_s = 0.0; }, "tanh_deg_per_s = 0");
  refused(r, [](PwR& p) { p.dead_band_deg = -1.0; }, "dead_band_deg = -1");
  // A map may fall on one side only, where only that side reaches far enough.
  refused(r, [](PwR& p) { p.above.square_per_deg = -5e-3, p.above.cube_per_deg2 = -4e-5; }, "above_square_per_deg");
  refused(
      r,
      [](PwR& p) {
        p.frame.closed_deg = -10.0, p.limp_home_deg = 80.0, p.below.square_per_deg = 5e-3, p.below.cube_per_deg2 = 0.0;
      },
      "below_square_per_deg");
  refused(asymmetric_pw_w(), [](PwW& p) { p.knot_upper_duty = -0.27; }, "must be above knot_lower_duty");
  refused(asymmetric_pw_w(), [](PwW& p) { p.knot_lower_duty = -1.1; }, "knot_lower_duty = -1.1");
  refused(asymmetric_pw_p(), [](PwP& p) { p.plays = 0; }, "plays = 0");
  for (const auto& [member, name] : {std::pair{&ObserverGains::angle_gain, "angle_gain"},
                                     {&ObserverGains::speed_gain_per_s, "speed_gain_per_s"},
                                     {&ObserverGains::bias_gain_duty_per_deg, "bias_gain_duty_per_deg"},
                                     {&ObserverGains::bias_limit_duty, "bias_limit_duty"},
                                     {&ObserverGains::offset_gain, "offset_gain"}}) {
    refused(ObserverGains{}, [member = member](ObserverGains& a) { a.*member = -0.1; }, std::string(name) + " = -0.1");
    refused(ObserverGains{}, [member = member](ObserverGains& a) { a.*member = 2e4; }, std::string(name) + " = 20000");
  }
}

}  // namespace
}  // namespace mgdd::throttle
