// Every combination of options: nothing throws, lanes hold the bits of plain code.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"
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
  EXPECT_TRUE(simulate_many({}, {.duty = duty}, 3, 2e-4).empty());
  EXPECT_THROW(simulate_many(cases, {.duty = duty}, 3, 6e-3), ParameterError);
  const std::vector<double> percent(duty.size(), 35.0), short_supply(2, 12.0);
  EXPECT_THROW(simulate_many(cases, {.duty = percent}, 3, 2e-4), DataError);
  EXPECT_THROW(simulate_many(cases, {.duty = duty, .supply_v = short_supply}, 3, 2e-4), ShapeError);
  for (const bool friction : {true, false}) {
    auto mixed = cases;
    if (friction) {
      mixed[5].throttle.friction = Friction::tanh;
    } else {
      mixed[5].throttle.backlash = Backlash::none;
    }
    EXPECT_THROW(simulate_many(mixed, {.duty = duty}, 3, 2e-4), ParameterError);
  }
  auto bad = cases;
  bad[8].throttle.inertia_kgm2 = -1.0;
  EXPECT_THROW(simulate_many(bad, {.duty = duty}, 3, 2e-4), ParameterError);
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

}  // namespace
}  // namespace mgdd::throttle
