// A throttle driven by hand: set a duty, wait, ask for the angle.
#pragma once

#include <cmath>

#include "mgdd/common/units.hpp"
#include "mgdd/throttle/plant.hpp"

namespace mgdd::test {

inline double deg(double rad) {
  return rad / units::rad_per_deg;
}
inline double rad(double degrees) {
  return degrees * units::rad_per_deg;
}

struct DrivenThrottle {
  throttle::Throttle parameters;
  throttle::ThrottlePlant plant;
  throttle::ThrottleState state;
  throttle::ThrottleInput input{};

  explicit DrivenThrottle(const throttle::Throttle& t, double start_deg, double step_s = throttle::default_step_s)
      : parameters(t), plant(t, step_s), state(throttle::at_rest(start_deg)) {
    input.supply_v = t.supply_v;
  }
  double angle_deg() const { return deg(state.plate_angle_rad); }
  void step(double duty) {
    input.duty = duty;
    plant.step(state, input);
  }
  void go(double duty, double seconds) {
    const long n = std::lround(seconds / plant.step_s());
    for (long k = 0; k < n; ++k)
      step(duty);
  }
  /// Duty of a ramp at the first moment when `stop(*this)` holds; gives up after 100 s.
  template <class Condition>
  double ramp(double from, double per_second, Condition stop) {
    double time = 0.0;
    for (long k = 1; time < 100.0 && !stop(*this); ++k) {
      step(from + per_second * time);
      time = static_cast<double>(k) * plant.step_s();
    }
    return from + per_second * time;
  }
  /// Seconds until the angle reaches `target_deg` from either side.
  double until(double duty, double target_deg) {
    const double sign = target_deg > angle_deg() ? 1.0 : -1.0;
    long k = 0;
    for (; k < 1'000'000 && sign * (angle_deg() - target_deg) < 0.0; ++k)
      step(duty);
    return static_cast<double>(k) * plant.step_s();
  }
  /// Spring torque at an angle [N m], positive when it closes.
  double spring_nm(double angle) const {
    const bool above = angle >= parameters.limp_home_deg;
    const double x = angle - parameters.limp_home_deg;
    const double share = std::fmax(-1.0, std::fmin(1.0, x / parameters.preload_ramp_deg));
    return (above ? parameters.spring_above_nm_per_rad : parameters.spring_below_nm_per_rad) * rad(x) +
           (above ? parameters.preload_above_nm : parameters.preload_below_nm) * share;
  }
};

/// P2 with one level of friction: a stiff spring on the motor of P1.
inline throttle::Throttle stiff_spring() {
  throttle::Throttle t;
  t.spring_above_nm_per_rad = t.spring_below_nm_per_rad = 0.819;
  t.preload_above_nm = t.preload_below_nm = 0.20;
  t.coulomb_nm = t.stiction_nm = 0.10;
  return t;
}

}  // namespace mgdd::test
