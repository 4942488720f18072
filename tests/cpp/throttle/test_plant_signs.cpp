// Which way every input and every parameter moves the plate, as laws, on a throttle without symmetry.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;
using test::DrivenThrottle;

constexpr double start_deg = 40.0;

/// Angle after 30 ms from rest under constant inputs.
double reached_deg(const Throttle& p, const ThrottleInput& in, double from_deg = start_deg) {
  DrivenThrottle t(p, from_deg);
  t.input = in;
  t.go(in.duty, 0.03);
  return t.angle_deg();
}

template <class Visit>
void every_form(Visit visit) {
  for (const auto& [friction, friction_name] : names<Friction>()) {
    for (const auto& [backlash, backlash_name] : names<Backlash>()) {
      Throttle p = asymmetric_throttle();
      p.friction = friction;
      p.backlash = backlash;
      visit(p, std::string(friction_name) + ", " + std::string(backlash_name));
    }
  }
}

/// The angle never falls with the input, and rises from the first to the last.
void expect_opening(const std::vector<double>& values, const std::function<double(double)>& angle_of,
                    const std::string& where) {
  double before = -1e9;
  for (const double value : values) {
    const double angle = angle_of(value);
    EXPECT_GE(angle, before) << where << " at " << value;
    before = angle;
  }
  EXPECT_GT(before, angle_of(values.front()) + 0.2) << where;
}

TEST(PlantSigns, DutyOpens) {
  every_form([](const Throttle& p, const std::string& form) {
    const auto at = [&](double duty) { return reached_deg(p, {.duty = duty, .supply_v = p.supply_v}); };
    expect_opening({-1.3, -1.0, -0.6, -0.3, 0.0, 0.2, 0.5, 0.8, 1.0}, at, form);
    EXPECT_LT(at(-1.0), start_deg - 5.0) << form;
    EXPECT_GT(at(1.0), start_deg + 5.0) << form;
    EXPECT_EQ(at(1.3), at(1.0)) << form;
    EXPECT_EQ(at(-1.3), at(-1.0)) << form;
  });
}

TEST(PlantSigns, SupplyStrengthensTheDutyEitherWay) {
  every_form([](const Throttle& p, const std::string& form) {
    const std::vector<double> volts{0.3, 6.0, 9.0, 12.0, 15.0};
    expect_opening(volts, [&](double v) { return reached_deg(p, {.duty = 0.8, .supply_v = v}); }, form);
    expect_opening(volts, [&](double v) { return -reached_deg(p, {.duty = -0.8, .supply_v = v}); }, form);
    EXPECT_EQ(reached_deg(p, {.duty = 0.0, .supply_v = 6.0}), reached_deg(p, {.duty = 0.0, .supply_v = 15.0})) << form;
  });
}

TEST(PlantSigns, ExternalAirTorqueOpensAndThePressureDropCloses) {
  every_form([](const Throttle& p, const std::string& form) {
    const auto blown = [&](double nm) {
      return reached_deg(p, {.duty = 0.25, .supply_v = p.supply_v, .airflow_torque_nm = nm}, 70.0);
    };
    expect_opening({-0.9, -0.5, -0.2, 0.0, 0.2, 0.5, 0.9}, blown, form);
    const auto throttled = [&](double kpa) {
      Throttle q = p;
      q.pressure_drop_kpa = kpa;
      return -reached_deg(q, {.duty = 0.25, .supply_v = p.supply_v}, 70.0);
    };
    expect_opening({0.0, 20.0, 60.0, 90.0}, throttled, form);
  });
}

TEST(PlantSigns, AnExternalTorqueActsAsMuchAsTheSameTorqueOfTheMotor) {
  Throttle p = asymmetric_throttle();
  p.inductance_mh = 0.0;
  const double duty = 0.4;
  const double left = duty - p.dead_band;
  const double torque = p.stall_torque_nm() * left;
  EXPECT_NEAR(reached_deg(p, {.duty = duty, .supply_v = p.supply_v}),
              reached_deg(p, {.duty = 0.0, .supply_v = p.supply_v, .airflow_torque_nm = torque}), 1e-9);
  EXPECT_NEAR(reached_deg(p, {.duty = -duty, .supply_v = p.supply_v}),
              reached_deg(p, {.duty = 0.0, .supply_v = p.supply_v, .airflow_torque_nm = -torque}), 1e-9);
}

TEST(PlantSigns, TheStalledCurrentIsWhatSupplyDriverAndDeadBandLeave) {
  Throttle p = asymmetric_throttle();
  p.coulomb_nm = p.stiction_nm = 50.0;  // holds everything
  for (const auto& [duty, volts] : {std::pair{0.7, 13.3}, {0.7, 9.0}, {-0.4, 13.3}, {0.02, 13.3}, {-0.03, 9.0}}) {
    for (const Bridge bridge : {Bridge::brake, Bridge::open}) {
      DrivenThrottle t(p, start_deg);
      t.input.supply_v = volts;
      t.input.bridge = bridge;
      t.go(duty, 0.2);
      const double left = std::fmax(std::abs(duty) - 0.03, 0.0) * (duty < 0.0 ? -1.0 : 1.0);
      EXPECT_NEAR(t.state.current_a, left * (volts - 0.6) / (1.7 + 0.22), 1e-9) << duty;
      EXPECT_EQ(t.angle_deg(), start_deg);
    }
  }
  EXPECT_NEAR(p.stall_torque_nm(), 0.35 * (13.3 - 0.6) / (1.7 + 0.22), 1e-15);
  EXPECT_NEAR(p.damping_nms_per_rad(), 0.0102 + 0.35 * 0.41 / (1.7 + 0.22), 1e-15);
}

TEST(PlantSigns, AnOpenBridgeDoesNotBrakeAndABrakingOneDoes) {
  Throttle p = asymmetric_throttle();
  p.coulomb_nm = p.stiction_nm = 0.0;
  const auto end_speed = [&](Bridge bridge, double duty) {
    DrivenThrottle t(p, start_deg);
    t.input.bridge = bridge;
    t.state.speed_rad_per_s = 10.0;
    t.go(duty, 0.004);
    return t.state.speed_rad_per_s;
  };
  EXPECT_GT(end_speed(Bridge::open, 0.0), end_speed(Bridge::brake, 0.0) + 0.5);
  EXPECT_EQ(end_speed(Bridge::open, 0.02), end_speed(Bridge::open, 0.0)) << "inside the dead band";
  EXPECT_EQ(end_speed(Bridge::open, 0.1), end_speed(Bridge::brake, 0.1)) << "a driven bridge is a driven bridge";
}

// --- every parameter ------------------------------------------------------------------------------------------

/// 1: a larger number opens further, -1: less far, 0: does not act at all.
struct Way {
  std::string_view field;
  int opening;  ///< full duty from below limp-home to 30 ms later
  int closing;  ///< the same downwards from above it, as movement
};

// Stribeck friction and a play: smooth enough for a law without exceptions. Limp-home is passed on neither way.
TEST(PlantSigns, EveryParameterActsOnItsSideAndItsWay) {
  const Way ways[] = {
      {"inertia_kgm2", -1, -1},
      {"viscous_nms_per_rad", -1, -1},
      {"torque_constant_nm_per_a", 1, 1},
      {"back_emf_vs_per_rad", -1, -1},
      {"resistance_ohm", -1, -1},
      {"inductance_mh", -1, -1},
      {"supply_v", 0, 0},  // the input's supply is what acts
      {"driver_drop_v", -1, -1},
      {"driver_resistance_ohm", -1, -1},
      {"dead_band", -1, -1},
      {"coulomb_nm", -1, -1},
      {"stribeck_rad_per_s", -1, -1},
      {"karnopp_rad_per_s", 0, 0},
      {"tanh_rad_per_s", 0, 0},
      {"bristle_nm_per_rad", 0, 0},
      {"bristle_damping_nms_per_rad", 0, 0},
      {"spring_above_nm_per_rad", -1, 0},
      {"spring_below_nm_per_rad", 0, -1},
      {"preload_above_nm", -1, 0},
      {"preload_below_nm", 0, -1},
      {"stop_stiffness_nm_per_rad", 0, 0},
      {"stop_damping_nms_per_rad", 0, 0},
      {"backlash_half_deg", -1, -1},
      {"gear_stiffness_nm_per_rad", 0, 0},
      {"gear_damping_nms_per_rad", 0, 0},
      {"plate_friction_share", 0, 0},
      {"bore_mm", -1, 0},
      {"pressure_drop_kpa", -1, 0},
  };
  Throttle p = asymmetric_throttle();
  p.friction = Friction::stribeck;
  p.backlash = Backlash::hysteresis;
  p.limp_home_deg = 30.0;
  for (const Way& way : ways) {
    const auto all = fields();
    const auto field = find_field(all, way.field);
    ASSERT_NE(field, all.end()) << way.field;
    for (const bool opens : {true, false}) {
      const auto travel = [&](double factor) {
        Throttle q = p;
        field->in(q) *= factor;
        if (!opens) q.pressure_drop_kpa = 0.0;
        const double from = opens ? 32.0 : 28.0;
        const double duty = opens ? 0.5 : -0.5;
        return (opens ? 1.0 : -1.0) * (reached_deg(q, {.duty = duty, .supply_v = p.supply_v}, from) - from);
      };
      EXPECT_GT(travel(1.0), 3.0);
      EXPECT_LT(travel(1.0), opens ? 50.0 : 26.0) << "off the stops";
      const double more = travel(1.1) - travel(1.0);
      const int expected = opens ? way.opening : way.closing;
      EXPECT_EQ(more > 1e-12 ? 1 : more < -1e-12 ? -1 : 0, expected) << way.field << (opens ? " opening" : " closing");
    }
  }
}

TEST(PlantSigns, EachStopHoldsItsOwnEnd) {
  for (const Backlash backlash : {Backlash::none, Backlash::compliance}) {
    Throttle p = asymmetric_throttle();
    p.backlash = backlash;
    p.coulomb_nm = p.stiction_nm = 0.0;
    p.pressure_drop_kpa = 0.0;
    p.dead_band = 0.0;
    for (const double duty : {1.0, -1.0}) {
      DrivenThrottle t(p, start_deg);
      t.go(duty, 3.0);
      const double stall = duty * p.stall_torque_nm();
      const double load = stall - t.spring_nm(t.angle_deg());
      const double end = duty > 0.0 ? p.open_deg : p.closed_deg;
      EXPECT_NEAR(test::rad(t.angle_deg() - end) * p.stop_stiffness_nm_per_rad, load, 1e-4 * std::abs(load)) << duty;
      const double bend = stall / p.gear_stiffness_nm_per_rad + duty * test::rad(p.backlash_half_deg);
      EXPECT_NEAR(t.state.angle_rad - t.state.plate_angle_rad, backlash == Backlash::none ? 0.0 : bend, 1e-6) << duty;
    }
  }
}

// --- columns --------------------------------------------------------------------------------------------------

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

TEST(PlantSigns, ColumnsShowThePlateInDegrees) {
  Throttle p = asymmetric_throttle();
  p.backlash = Backlash::compliance;
  const std::vector<double> duty{0.9, 0.9, -0.4, -0.4, 0.2};
  std::vector<double> angle(5), speed(5), current(5);
  ThrottleState state = at_rest(start_deg);
  simulate(ThrottlePlant(p), {.duty = duty}, 20, state,
           {.angle_deg = angle, .speed_deg_per_s = speed, .current_a = current});
  DrivenThrottle t(p, start_deg);
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_NEAR(angle[k], t.angle_deg(), 1e-12);
    EXPECT_NEAR(speed[k], test::deg(t.state.plate_speed_rad_per_s), 1e-9);
    EXPECT_EQ(current[k], t.state.current_a);
    if (k < 4) t.go(duty[k], 20e-4);
  }
  EXPECT_EQ(state.plate_angle_rad, t.state.plate_angle_rad) << "the state stands at the last sample";
  EXPECT_EQ(state.current_a, t.state.current_a);
  EXPECT_NE(state.angle_rad, state.plate_angle_rad);
}

}  // namespace
}  // namespace mgdd::throttle
