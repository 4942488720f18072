// What a controller asks about dry friction: stuck or sliding, and the duty at which motion begins.
#include "mgdd/throttle/models/first_principle.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/plant.hpp"
#include "support/test.hpp"

namespace mgdd::throttle {
namespace {

Throttle uneven() {
  Throttle t;
  t.spring_above_nm_per_rad = 0.12;
  t.spring_below_nm_per_rad = 0.31;
  t.preload_above_nm = 0.37;
  t.preload_below_nm = 0.52;
  t.limp_home_deg = 9.0;
  t.dead_band = 0.03;
  t.driver_drop_v = 0.7;
  t.driver_resistance_ohm = 0.2;
  return t;
}

/// At rest at an angle under the duty that balances spring and air.
template <class M>
typename M::State balanced(const M& model, double angle_deg) {
  const auto edge = model.breakaway(model.at_rest(angle_deg));
  return model.at_rest(angle_deg, 0.5 * (edge.down + edge.up));
}
ThrottleState balanced(const ThrottlePlant& plant, double angle_deg) {
  ThrottleState state = plant.at_rest(angle_deg);
  const auto& c = plant.coefficients();
  const auto edge = plant.breakaway(state);
  const auto volts = [&](double duty) {
    return std::copysign(std::abs(duty) - c.dead_band, duty) * (c.supply - c.drop);
  };
  state.current_a = 0.5 * (volts(edge.down) + volts(edge.up)) / c.resistance;
  return state;
}

/// Largest distance from the start under a held duty; a plate that moved was seen sliding.
template <class M>
double moved(const M& model, typename M::State state, double duty, int samples) {
  const double start = model.output(state);
  double most = 0.0;
  bool slid = false;
  for (int k = 0; k < samples; ++k) {
    model.step(state, dynamics::input_of(model, duty));
    most = std::max(most, std::abs(model.output(state) - start));
    slid = slid || !model.stuck(state);
  }
  EXPECT_EQ(slid, most > 0.0) << duty;
  return most;
}

template <class M>
void expect_breakaway(const M& model, double angle_deg, int samples) {
  const auto state = balanced(model, angle_deg);
  const auto edge = model.breakaway(state);
  ASSERT_LT(edge.down, edge.up);
  constexpr double little = 1e-5;
  EXPECT_EQ(moved(model, state, edge.up - little, samples), 0.0) << angle_deg;
  EXPECT_EQ(moved(model, state, edge.down + little, samples), 0.0) << angle_deg;
  EXPECT_GT(moved(model, state, edge.up + little, samples), 0.0) << angle_deg;
  EXPECT_GT(moved(model, state, edge.down - little, samples), 0.0) << angle_deg;
}

TEST(Breakaway, JustBelowHoldsAndJustAboveMovesOnEveryModelAndSide) {
  for (const double angle : {3.0, 8.9, 9.1, 30.0, 80.0}) {
    for (const auto friction : {Friction::coulomb, Friction::stiction, Friction::stribeck, Friction::karnopp}) {
      Throttle t = uneven();
      t.friction = friction;
      t.stiction_nm = friction == Friction::coulomb ? t.coulomb_nm : 0.33;
      t.pressure_drop_kpa = 4.0;
      expect_breakaway(ThrottlePlant(t), angle, 400);  // 40 ms: the current has settled
    }
    const auto groups = first_principle_of(uneven());
    expect_breakaway(FirstPrinciple{}.prepare<double>(groups, 1e-3), angle, 40);
    Throttle dropping = uneven();
    dropping.friction = Friction::stribeck;
    dropping.stiction_nm = 0.33;
    expect_breakaway(FirstPrinciple{}.prepare<double>(first_principle_of(dropping), 1e-3), angle, 40);
    PwR p = pw_r_of(uneven());
    expect_breakaway(PwRModel(p), angle, 40);
    p.frame.delay_samples = 2.5;
    expect_breakaway(PwRModel(p), angle, 40);
  }
}

TEST(Breakaway, TheThreeModelsAgreeOnTheSameThrottle) {
  Throttle t = uneven();
  t.dead_band = 0.0;
  const PwRModel pw_r(pw_r_of(t));
  const auto groups = FirstPrinciple{}.prepare<double>(first_principle_of(t), 1e-3);
  const ThrottlePlant plant(t);
  for (const double angle : {2.0, 8.95, 9.2, 40.0}) {
    const auto a = pw_r.breakaway(pw_r.at_rest(angle));
    const auto b = groups.breakaway(groups.at_rest(angle));
    const auto c = plant.breakaway(plant.at_rest(angle));
    for (const auto& other : {b, c}) {
      EXPECT_NEAR(other.up, a.up, 1e-12);
      EXPECT_NEAR(other.down, a.down, 1e-12);
    }
  }
}

TEST(Breakaway, ABiasAndADeadBandShiftIt) {
  const PwRModel model{PwR{}};
  auto state = model.at_rest(30.0);
  const auto before = model.breakaway(state);
  state.bias_duty = 0.05;
  EXPECT_NEAR(model.breakaway(state).up, before.up + 0.05, 1e-15);
  Throttle t = uneven();
  const ThrottlePlant with(t);
  t.dead_band = 0.0;
  const ThrottlePlant without(t);
  EXPECT_NEAR(with.breakaway(with.at_rest(40.0)).up - without.breakaway(without.at_rest(40.0)).up, 0.03, 1e-12);
  EXPECT_NEAR(with.breakaway(with.at_rest(3.0)).down - without.breakaway(without.at_rest(3.0)).down, -0.03, 1e-12);
}

TEST(Breakaway, APlayMovesAtItsEdges) {
  PwP p;
  p.plays = 2;
  p.radius_duty = {0.05, 0.08};
  p.gain_deg_per_duty = {100.0, 50.0};
  p.first_s = p.second_s = 0.002;
  const PwPModel model(p);
  const auto edge = model.breakaway(model.at_rest(8.0));
  EXPECT_DOUBLE_EQ(edge.up, 0.05);
  EXPECT_DOUBLE_EQ(edge.down, -0.05);
  auto state = model.at_rest(8.0);
  for (int k = 0; k < 300; ++k) {
    model.step(state, 0.0499);
    EXPECT_TRUE(model.stuck(state));
  }
  EXPECT_EQ(model.output(state), 8.0);
  for (int k = 0; k < 300; ++k)
    model.step(state, 0.0501);
  EXPECT_GT(model.output(state), 8.0);
}

TEST(SmoothFriction, CreepsAndIsNeverStuck) {
  PwR p;
  p.friction = Friction::tanh;
  const PwRModel model(p);
  auto state = model.at_rest(30.0);
  const auto edge = model.breakaway(state);
  EXPECT_EQ(edge.up, edge.down);
  for (int k = 0; k < 50; ++k)
    model.step(state, edge.up + 0.01);
  EXPECT_FALSE(model.stuck(state));
  EXPECT_GT(model.output(state), 30.0);
}

}  // namespace
}  // namespace mgdd::throttle
