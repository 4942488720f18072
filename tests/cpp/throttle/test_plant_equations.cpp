// Every step of the plant solves the equations it stands for. They are written here once more, term by term in the
// units of the parameters, and the friction that a step has applied is what is left of the torque balance.
#include <map>

#include "mgdd/common/random.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/test.hpp"
#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;
using test::deg;
using test::rad;

constexpr double rest_rad_per_s = 1e-9;
constexpr double tolerance_nm = 2e-9;

double sign_of(double x) {
  return x < 0.0 ? -1.0 : 1.0;
}

/// What acts on a shaft during one step, as functions of the speed at its end.
struct Equations {
  const Throttle& p;
  double h = 0.0;
  ThrottleState from;
  ThrottleInput in;

  double volts() const {
    const double duty = std::clamp(in.duty, -1.0, 1.0);
    const double left = std::max(std::abs(duty) - p.dead_band, 0.0);
    return sign_of(duty) * left * std::max(in.supply_v - p.driver_drop_v, 0.0);
  }
  bool no_current() const { return in.bridge == Bridge::open && std::abs(in.duty) <= p.dead_band; }
  /// L (i - i0)/h + (R + R_driver) i + K_e w = volts.
  double current(double w) const {
    if (no_current()) return 0.0;
    const double l_over_h = 1e-3 * p.inductance_mh / h;
    return (l_over_h * from.current_a + volts() - p.back_emf_vs_per_rad * w) /
           (l_over_h + p.resistance_ohm + p.driver_resistance_ohm);
  }
  /// Of the springs at the angle that the step began at, with the slope there for the way to its end.
  double spring(double angle_rad, double w) const {
    const double x = angle_rad - rad(p.limp_home_deg);
    const bool above = x >= 0.0;
    const double ramp = x / rad(p.preload_ramp_deg);
    const double preload = above ? p.preload_above_nm : p.preload_below_nm;
    const double stiffness = above ? p.spring_above_nm_per_rad : p.spring_below_nm_per_rad;
    const double slope = stiffness + (std::abs(ramp) <= 1.0 ? preload / rad(p.preload_ramp_deg) : 0.0);
    return stiffness * x + preload * std::clamp(ramp, -1.0, 1.0) + slope * h * w;
  }
  double stop(double angle_rad, double w) const {
    const double below = rad(p.closed_deg) - angle_rad;
    const double beyond = angle_rad - rad(p.open_deg);
    if (below <= 0.0 && beyond <= 0.0) return 0.0;
    return p.stop_stiffness_nm_per_rad * ((below > 0.0 ? below : -beyond) - h * w) - p.stop_damping_nms_per_rad * w;
  }
  double air(double angle_rad) const { return in.airflow_torque_nm + airflow_torque_nm(p, deg(angle_rad)); }
};

/// One side of the gap, or the whole throttle, at the start of a step.
struct Shaft {
  double speed, bristle, new_bristle;
  double inertia, share;
  double h;
};

double level(const Throttle& p, double share, double speed) {
  const double ratio = speed / p.stribeck_rad_per_s;
  return share * (p.coulomb_nm + (p.stiction_nm - p.coulomb_nm) * std::exp(-ratio * ratio));
}

std::map<std::string, int> seen;  // regimes met, so that a test that meets none of one fails

/// `left(w)`: all torques but friction, less inertia times acceleration, if the new speed were w.
template <class Left>
void expect_friction(const Throttle& p, const Shaft& s, double now, Left left, const std::string& where) {
  const double friction = left(now);
  const double push = left(0.0);  // what friction must hold for a stop
  const double coulomb = s.share * p.coulomb_nm;
  const double stiction = s.share * p.stiction_nm;
  const bool rests = std::abs(s.speed) < rest_rad_per_s;
  const auto set_valued = [&](double hold, double slide) {
    if (std::abs(push) <= hold) {
      ++seen["holds"];
      EXPECT_EQ(now, 0.0) << where;
    } else {
      ++seen["slides"];
      EXPECT_NEAR(friction, slide * sign_of(push), tolerance_nm) << where;
      EXPECT_GT(now * push, 0.0) << where;
    }
  };
  switch (p.friction) {
    case Friction::coulomb:
      return set_valued(coulomb, coulomb);
    case Friction::stiction:
      return set_valued(rests ? stiction : coulomb, coulomb);
    case Friction::stribeck: {
      const double curve = level(p, s.share, s.speed);
      return set_valued(rests ? stiction : curve, rests ? coulomb : curve);
    }
    case Friction::karnopp: {
      const double net = push - s.inertia / s.h * s.speed;
      if (std::abs(s.speed) < p.karnopp_rad_per_s) {
        const bool holds = std::abs(net) <= stiction;
        ++seen[holds ? "band holds" : "band leaves"];
        EXPECT_NEAR(holds ? now : friction, holds ? 0.0 : coulomb * sign_of(net), tolerance_nm) << where;
      } else if (now == 0.0) {  // stopped: free to slide on, it would have turned round
        ++seen["reversal"];
        EXPECT_LE(sign_of(s.speed) * push, level(p, s.share, s.speed) + tolerance_nm) << where;
      } else {
        ++seen["outside"];
        EXPECT_GT(now * s.speed, 0.0) << where << ": friction drives";
        EXPECT_NEAR(friction, level(p, s.share, s.speed) * sign_of(s.speed), tolerance_nm) << where;
      }
      return;
    }
    case Friction::tanh: {
      const double t = std::tanh(s.speed / p.tanh_rad_per_s);
      const double slope = (1.0 - t * t) / p.tanh_rad_per_s;
      EXPECT_NEAR(friction, coulomb * (t + slope * (now - s.speed)), tolerance_nm) << where;
      return;
    }
    case Friction::lugre: {
      const double rate = (s.new_bristle - s.bristle) / s.h;
      EXPECT_NEAR(rate, now - p.bristle_nm_per_rad * std::abs(s.speed) / level(p, 1.0, s.speed) * s.new_bristle,
                  1e-9 * (1.0 + std::abs(now)))
          << where;
      const double whole = p.bristle_nm_per_rad * s.new_bristle + p.bristle_damping_nms_per_rad * rate;
      EXPECT_NEAR(friction, s.share * whole, tolerance_nm) << where;
      return;
    }
  }
}

void expect_one_mass(const Throttle& p, const Equations& e, const ThrottleState& to, const ThrottleTorques& booked,
                     const std::string& where) {
  const ThrottleState& from = e.from;
  const double h = e.h;
  const double w = to.speed_rad_per_s;
  const auto left = [&](double speed) {
    return p.torque_constant_nm_per_a * e.current(speed) - p.viscous_nms_per_rad * speed -
           e.spring(from.angle_rad, speed) + e.stop(from.angle_rad, speed) + e.air(from.angle_rad) -
           p.inertia_kgm2 / h * (speed - from.speed_rad_per_s);
  };
  expect_friction(p, {from.speed_rad_per_s, from.bristle_rad, to.bristle_rad, p.inertia_kgm2, 1.0, h}, w, left, where);
  EXPECT_NEAR(to.current_a, e.current(w), 1e-9) << where;
  EXPECT_NEAR(to.angle_rad, from.angle_rad + h * w, 1e-15) << where;
  EXPECT_EQ(to.plate_speed_rad_per_s, w) << where;
  const double half = p.backlash == Backlash::hysteresis ? rad(p.backlash_half_deg) : 0.0;
  EXPECT_NEAR(to.plate_angle_rad, std::clamp(from.plate_angle_rad, to.angle_rad - half, to.angle_rad + half), 1e-15)
      << where;
  EXPECT_NEAR(booked.motor_nm, p.torque_constant_nm_per_a * e.current(w), tolerance_nm) << where;
  EXPECT_NEAR(booked.viscous_nm, p.viscous_nms_per_rad * w, tolerance_nm) << where;
  EXPECT_NEAR(booked.friction_nm, left(w), tolerance_nm) << where;
  EXPECT_NEAR(booked.spring_nm, e.spring(from.angle_rad, w), tolerance_nm) << where;
  EXPECT_NEAR(booked.stop_nm, e.stop(from.angle_rad, w), tolerance_nm) << where;
  EXPECT_NEAR(booked.air_nm, e.air(from.angle_rad), tolerance_nm) << where;
}

void expect_two_masses(const Throttle& p, const Equations& e, const ThrottleState& to, const ThrottleTorques& booked,
                       const std::string& where) {
  const ThrottleState& from = e.from;
  const double h = e.h;
  const double w = to.speed_rad_per_s;
  const double plate_w = to.plate_speed_rad_per_s;
  const double gap = from.angle_rad - from.plate_angle_rad;
  const double side = sign_of(gap);
  const double over = std::abs(gap) - rad(p.backlash_half_deg);
  const double closing = side * (from.speed_rad_per_s - from.plate_speed_rad_per_s);
  const double pressed = p.gear_stiffness_nm_per_rad * over + p.gear_damping_nms_per_rad * closing;
  const bool touches = over > 0.0 && pressed > 0.0;  // teeth push and never pull
  ++seen[touches ? (side > 0.0 ? "motor pushes open" : "motor pushes closed") : "gap"];
  if (over > 0.0 && !touches) ++seen["parting"];
  const auto contact = [&](double motor, double plate) {
    if (!touches) return 0.0;
    const double relative = motor - plate;
    return side * p.gear_stiffness_nm_per_rad * over + p.gear_stiffness_nm_per_rad * h * relative +
           p.gear_damping_nms_per_rad * relative;
  };
  const double motor_share = 1.0 - p.plate_friction_share;
  const double motor_inertia = p.inertia_kgm2 - p.plate_inertia_kgm2;
  const auto motor_left = [&](double speed) {
    return p.torque_constant_nm_per_a * e.current(speed) - motor_share * p.viscous_nms_per_rad * speed -
           contact(speed, plate_w) - motor_inertia / h * (speed - from.speed_rad_per_s);
  };
  const auto plate_left = [&](double speed) {
    return contact(w, speed) - p.plate_friction_share * p.viscous_nms_per_rad * speed -
           e.spring(from.plate_angle_rad, speed) + e.stop(from.plate_angle_rad, speed) + e.air(from.plate_angle_rad) -
           p.plate_inertia_kgm2 / h * (speed - from.plate_speed_rad_per_s);
  };
  expect_friction(p, {from.speed_rad_per_s, from.bristle_rad, to.bristle_rad, motor_inertia, motor_share, h}, w,
                  motor_left, where + ", motor");
  expect_friction(p,
                  {from.plate_speed_rad_per_s, from.plate_bristle_rad, to.plate_bristle_rad, p.plate_inertia_kgm2,
                   p.plate_friction_share, h},
                  plate_w, plate_left, where + ", plate");
  EXPECT_NEAR(to.current_a, e.current(w), 1e-9) << where;
  EXPECT_NEAR(to.angle_rad, from.angle_rad + h * w, 1e-15) << where;
  EXPECT_NEAR(to.plate_angle_rad, from.plate_angle_rad + h * plate_w, 1e-15) << where;
  EXPECT_NEAR(booked.motor_nm, p.torque_constant_nm_per_a * e.current(w), tolerance_nm) << where;
  EXPECT_NEAR(booked.viscous_nm, p.viscous_nms_per_rad * (motor_share * w + p.plate_friction_share * plate_w),
              tolerance_nm)
      << where;
  EXPECT_NEAR(booked.friction_nm, motor_left(w) + plate_left(plate_w), tolerance_nm) << where;
  EXPECT_NEAR(booked.spring_nm, e.spring(from.plate_angle_rad, plate_w), tolerance_nm) << where;
  EXPECT_NEAR(booked.stop_nm, e.stop(from.plate_angle_rad, plate_w), tolerance_nm) << where;
  EXPECT_NEAR(booked.air_nm, e.air(from.plate_angle_rad), tolerance_nm) << where;
}

/// Random numbers by name, the same in every run.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : seed_(seed) {}
  double operator()(double low, double high) { return low + (high - low) * random::uniform(seed_, 5, index_++); }
  bool chance(double share) { return (*this)(0.0, 1.0) < share; }

 private:
  std::uint64_t seed_, index_ = 0;
};

/// At rest, creeping inside Karnopp's band, or swinging.
double some_speed(Draw& draw) {
  if (draw.chance(0.3)) return 0.0;
  return draw.chance(0.4) ? draw(-0.12, 0.12) : draw(-6.0, 6.0);
}

ThrottleState some_state(const Throttle& p, Draw& draw) {
  ThrottleState s = at_rest(draw.chance(0.2) ? p.limp_home_deg + draw(-0.6, 0.6) : draw(1.3, 86.2));
  s.speed_rad_per_s = some_speed(draw);
  s.current_a = draw(-3.0, 3.0);
  s.bristle_rad = draw(-2e-3, 2e-3);
  s.plate_bristle_rad = draw(-2e-3, 2e-3);
  s.plate_speed_rad_per_s = s.speed_rad_per_s;
  if (p.backlash != Backlash::none) s.plate_angle_rad += rad(draw(-0.5, 0.5));
  if (p.backlash == Backlash::compliance) s.plate_speed_rad_per_s = some_speed(draw);
  return s;
}

ThrottleInput some_input(const Throttle& p, Draw& draw, Bridge bridge) {
  ThrottleInput in;
  in.duty = draw.chance(0.2) ? draw(-p.dead_band, p.dead_band) : draw(-1.2, 1.2);
  in.supply_v = draw.chance(0.1) ? draw(0.0, 1.0) : draw(6.0, 16.0);
  in.airflow_torque_nm = draw(-0.2, 0.2);
  in.bridge = bridge;
  return in;
}

class PlantEquations : public testing::TestWithParam<Friction> {};

TEST_P(PlantEquations, HoldInEveryStep) {
  seen.clear();
  for (const Backlash backlash : {Backlash::none, Backlash::hysteresis, Backlash::compliance}) {
    Throttle p = asymmetric_throttle();
    p.friction = GetParam();
    p.backlash = backlash;
    const bool two = backlash == Backlash::compliance;
    const double h = two ? 2e-5 : backlash == Backlash::none ? 1e-3 : 1e-4;  // the sweeps of two masses converge
    const ThrottlePlant plant(p, h);
    Draw draw(11);
    for (int k = 0; k < 3000; ++k) {
      const ThrottleState from = some_state(p, draw);
      const ThrottleInput in = some_input(p, draw, k % 2 == 0 ? Bridge::brake : Bridge::open);
      ThrottleState to = from;
      ThrottleTorques booked;
      plant.step(to, in, booked);
      const std::string where = std::string(name_of(backlash)) + ", step " + std::to_string(k);
      (two ? expect_two_masses : expect_one_mass)(p, {p, h, from, in}, to, booked, where);
      if (HasFailure()) return;  // one is enough
    }
  }
  for (const char* const regime : {"motor pushes open", "motor pushes closed", "gap", "parting"})
    EXPECT_GT(seen[regime], 100) << regime;
  if (GetParam() == Friction::karnopp) {
    for (const char* const regime : {"band holds", "band leaves", "reversal", "outside"})
      EXPECT_GT(seen[regime], 10) << regime;
  } else if (GetParam() != Friction::tanh && GetParam() != Friction::lugre) {
    EXPECT_GT(seen["holds"], 100);
    EXPECT_GT(seen["slides"], 100);
  }
}

INSTANTIATE_TEST_SUITE_P(Friction, PlantEquations,
                         testing::Values(Friction::coulomb, Friction::stiction, Friction::stribeck, Friction::karnopp,
                                         Friction::tanh, Friction::lugre),
                         [](const auto& form) { return std::string(name_of(form.param)); });

TEST(AsymmetricThrottle, HasNoDefaultAndNoTwoEqualNumbers) {
  const Throttle p = asymmetric_throttle();
  EXPECT_NO_THROW(validate(p));
  const Throttle standard;
  for (const auto& field : fields()) {
    EXPECT_NE(field.in(p), field.in(standard)) << field.info.name;
    for (const auto& other : fields()) {
      if (&field != &other) {
        EXPECT_NE(field.in(p), other.in(p)) << field.info.name << " and " << other.info.name;
      }
    }
  }
}

}  // namespace
}  // namespace mgdd::throttle
