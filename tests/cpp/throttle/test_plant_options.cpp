// Every combination of options: nothing throws, lanes hold the bits of plain code, columns act from their own sample
// on, and a side without friction is the limit of one with little; test_plant_equations.cpp has the rest.
#include <type_traits>

#include "mgdd/common/error.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/throttle/plant.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/test.hpp"
#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

static_assert(noexcept(std::declval<const ThrottlePlant&>().step(std::declval<ThrottleState&>(),
                                                                 std::declval<const ThrottleInput&>())));
static_assert(noexcept(simulate(std::declval<const ThrottlePlant&>(), {}, 1, std::declval<ThrottleState&>(), {})));
static_assert(std::is_trivially_copyable_v<ThrottleState>);

constexpr Friction all_frictions[] = {Friction::coulomb, Friction::stiction, Friction::stribeck,
                                      Friction::karnopp, Friction::tanh,     Friction::lugre};
constexpr Backlash all_backlashes[] = {Backlash::none, Backlash::compliance, Backlash::hysteresis};

template <class Visit>
void every_combination(Visit visit) {
  for (const Friction friction : all_frictions) {
    for (const Backlash backlash : all_backlashes) {
      for (const Bridge bridge : {Bridge::brake, Bridge::open}) {
        for (const double inductance : {0.0, 1.5}) {
          for (const double air : {0.0, 10.0}) {
            Throttle t;
            t.stiction_nm = 0.31;
            t.friction = friction;
            t.backlash = backlash;
            t.inductance_mh = inductance;
            t.pressure_drop_kpa = air;
            t.dead_band = 0.02;
            t.driver_drop_v = 0.5;
            visit(t, bridge);
          }
        }
      }
    }
  }
}

std::vector<double> rough_duty(std::size_t n) {
  std::vector<double> duty(n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto i = static_cast<double>(k);
    duty[k] = k % 97 < 10 ? 0.0 : 0.9 * std::sin(0.05 * i) * std::cos(0.003 * i);
  }
  return duty;
}

TEST(ThrottleOptions, LanesHoldTheBitsOfThePlainCode) {
  const std::vector<double> duty = rough_duty(300);
  std::vector<double> supply(duty.size());
  std::vector<double> air(duty.size());
  for (std::size_t k = 0; k < duty.size(); ++k) {
    supply[k] = 12.0 + std::sin(0.1 * static_cast<double>(k));
    air[k] = -0.1 * std::cos(0.02 * static_cast<double>(k));
  }
  every_combination([&](const Throttle& base, Bridge bridge) {
    const ThrottleSignals signals{duty, supply, air, bridge};
    std::vector<ThrottleCase> cases;
    for (int i = 0; i < 11; ++i) {  // one full set of lanes and a part of another
      Throttle t = base;
      t.coulomb_nm *= 0.7 + 0.02 * i;
      t.preload_above_nm *= 1.0 + 0.05 * i;
      t.inertia_kgm2 *= 1.0 + 0.03 * i;
      cases.push_back({t, at_rest(5.0 + 7.0 * i)});
    }
    const std::vector<double> many = simulate_many(cases, signals, 10, 1e-4);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      ThrottleState state = cases[i].start;
      std::vector<double> angle(duty.size());
      ThrottleColumns columns;
      columns.angle_deg = angle;
      simulate(ThrottlePlant(cases[i].throttle), signals, 10, state, columns);
      for (std::size_t k = 0; k < duty.size(); ++k) {
        ASSERT_EQ(many[i * duty.size() + k], angle[k])
            << "case " << i << " sample " << k << " friction " << name_of(base.friction);
      }
    }
  });
}

// What observers and predictions take derivatives of is the same plant, with its friction, its backlash and its air.
TEST(ThrottleOptions, AnotherScalarKeepsTheOptions) {
  using D = Dual<2>;
  const std::vector<double> duty = rough_duty(150);
  every_combination([&](const Throttle& t, Bridge bridge) {
    const ThrottlePlant plant(t);
    const auto dual = plant.over<D>();
    ThrottleState state = at_rest(30.0);
    state.speed_rad_per_s = state.plate_speed_rad_per_s = 4.0;
    auto other = dynamics::lifted<std::remove_const_t<decltype(dual)>>(state);
    for (const double u : duty) {
      for (int k = 0; k < 10; ++k) {
        ThrottleInput input = plant.input(u);
        auto its = dual.input(D(u));
        input.bridge = its.bridge = bridge;
        plant.step(state, input);
        dual.step(other, its);
      }
      ASSERT_NEAR(dual.output(other).value, plant.output(state), 1e-9) << name_of(t.friction);
    }
  });
}

// Every number of a state reaches its lane: cases that start in the middle of a motion, with all of it different.
TEST(ThrottleOptions, LanesStartFromTheWholeState) {
  Throttle p = test::asymmetric_throttle();
  p.friction = Friction::lugre;
  p.backlash = Backlash::compliance;
  const std::vector<double> duty = rough_duty(40);
  std::vector<ThrottleCase> cases;
  for (int i = 0; i < 9; ++i) {
    ThrottleState s = at_rest(20.0 + 5.0 * i);
    s.speed_rad_per_s = 0.5 * i - 1.0;
    s.current_a = 1.0 - 0.3 * i;
    s.bristle_rad = 1e-4 * (i - 3);
    s.plate_angle_rad += test::rad(0.05 * i - 0.2);
    s.plate_speed_rad_per_s = 0.4 * i - 1.5;
    s.plate_bristle_rad = 2e-4 * (4 - i);
    p.pressure_drop_kpa = i < 4 ? 0.0 : 6.0;  // without and with air flow in one call
    cases.push_back({p, s});
  }
  const std::vector<double> many = simulate_many(cases, {.duty = duty}, 3, 2e-4);
  ASSERT_EQ(many.size(), 9 * duty.size());
  for (std::size_t i = 0; i < 9; ++i) {
    std::vector<double> angle(duty.size());
    ThrottleState state = cases[i].start;
    simulate(ThrottlePlant(cases[i].throttle, 2e-4), {.duty = duty}, 3, state, {.angle_deg = angle});
    for (std::size_t k = 0; k < duty.size(); ++k)
      ASSERT_NEAR(many[i * duty.size() + k], angle[k], 1e-11) << i << ' ' << k;
  }
  for (auto change : {+[](Throttle& t) { t.friction = Friction::tanh; }, +[](Throttle& t) { t.backlash = {}; }}) {
    auto mixed = cases;
    change(mixed[5].throttle);
    EXPECT_THROW(simulate_many(mixed, {.duty = duty}, 3, 2e-4), ParameterError);
  }
  EXPECT_TRUE(simulate_many({}, {.duty = duty}, 3, 2e-4).empty());
}

// A supply that falls below what the bridge drops drives nothing, and nothing backwards.
TEST(ThrottleOptions, ASupplyBelowTheDropDrivesNothing) {
  Throttle t;
  t.driver_drop_v = 2.0;
  test::DrivenThrottle low(t, 8.0);
  low.input.supply_v = 1.0;
  low.go(1.0, 0.2);
  EXPECT_EQ(low.state.current_a, 0.0);
  EXPECT_NEAR(low.angle_deg(), 8.0, 1e-12);
  low.input.supply_v = 12.0;
  low.go(1.0, 0.2);
  EXPECT_GT(low.angle_deg(), 80.0);
}

using test::DrivenThrottle;

// A side of the gap without friction is the limit of a side with next to none.
TEST(ThrottleLaws, ASideWithoutFrictionIsTheLimitOfATinyShare) {
  for (const Friction form : {Friction::coulomb, Friction::stiction, Friction::stribeck, Friction::karnopp,
                              Friction::tanh, Friction::lugre}) {
    for (const bool plate_is_free : {true, false}) {
      const auto with_share = [&](double share) {
        Throttle p;
        p.stiction_nm = 0.31;
        p.backlash = Backlash::compliance;
        p.friction = form;
        p.plate_friction_share = plate_is_free ? share : 1.0 - share;
        return DrivenThrottle(p, 30.0);
      };
      DrivenThrottle none = with_share(0.0);
      DrivenThrottle tiny = with_share(1e-9);
      double worst = 0.0;
      for (int k = 0; k < 5000; ++k) {
        const double duty = 0.2 + 0.4 * std::sin(2.5e-3 * k);
        none.step(duty);
        tiny.step(duty);
        ASSERT_TRUE(std::isfinite(none.angle_deg())) << static_cast<int>(form) << ' ' << k;
        worst = std::fmax(worst, std::abs(none.angle_deg() - tiny.angle_deg()));
      }
      EXPECT_LT(worst, 1e-4) << static_cast<int>(form) << ' ' << plate_is_free;
      EXPECT_GT(std::abs(none.angle_deg() - 30.0), 5.0);
    }
  }
}

// Bristles on both sides of a closed gap share the load as the friction is shared: the deflection is that of one mass.
TEST(ThrottleLaws, PreslidingIsTheSameHoweverTheFrictionIsShared) {
  Throttle whole;
  whole.friction = Friction::lugre;
  whole.inductance_mh = 0.0;
  const auto bend_deg = [](const Throttle& p) {
    DrivenThrottle t(p, 40.0);
    const double balance = t.spring_nm(40.0) / p.stall_torque_nm();
    t.go(balance + 0.2 * p.coulomb_nm / p.stall_torque_nm(), 0.3);
    return t.angle_deg() - 40.0;
  };
  const double expected = bend_deg(whole);
  EXPECT_GT(expected, 0.03);
  Throttle geared = whole;
  geared.backlash = Backlash::compliance;
  geared.backlash_half_deg = 1e-6;
  geared.gear_stiffness_nm_per_rad = 20000.0;
  for (const double share : {0.0, 0.3, 0.8, 1.0}) {
    geared.plate_friction_share = share;
    EXPECT_NEAR(bend_deg(geared), expected, 0.03 * expected) << share;
  }
}

using test::asymmetric_throttle;

constexpr double start_deg = 40.0;

// The inputs of sample k act from k to k + 1, in one run and in many.
TEST(PlantSigns, AColumnActsFromItsOwnSampleOn) {
  const Throttle p = asymmetric_throttle();
  const std::size_t n = 12;
  const std::vector<double> duty(n, 0.3), volts(n, 11.0), torque(n, 0.05);
  const auto runs = [&](const ThrottleSignals& signals) {
    std::vector<double> one(n);
    ThrottleState state = at_rest(start_deg);
    simulate(ThrottlePlant(p), signals, 10, state, {.angle_deg = one});
    const std::vector<ThrottleCase> cases{{p, at_rest(start_deg)}};
    EXPECT_EQ(simulate_many(cases, signals, 10, default_step_s), one);
    return one;
  };
  const std::vector<double> plain = runs({duty, volts, torque});
  const auto expect_change = [&](const ThrottleSignals& signals, double sign, const char* what) {
    const std::vector<double> changed = runs(signals);
    for (std::size_t k = 0; k < n; ++k) {
      if (k <= 5) {
        EXPECT_EQ(changed[k], plain[k]) << what << ' ' << k;
      } else {
        EXPECT_GT(sign * (changed[k] - plain[k]), 1e-6) << what << ' ' << k;
      }
    }
  };
  auto other = duty;
  other[5] = 0.6;
  expect_change({other, volts, torque}, 1.0, "duty");
  other = volts;
  other[5] = 14.0;
  expect_change({duty, other, torque}, 1.0, "supply_v");
  other = torque;
  other[5] = -0.4;
  expect_change({duty, volts, other}, -1.0, "airflow_torque_nm");
  const std::vector<double> own(n, p.supply_v), none(n, 0.0);
  EXPECT_EQ(runs({duty}), runs({duty, own, none})) << "left out: the parameter's supply and no extra torque";
}

}  // namespace
}  // namespace mgdd::throttle
