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
  /// Spring torque at an angle [N m], positive when it closes.
  double spring_nm(double angle) const {
    const bool above = angle >= parameters.limp_home_deg;
    const double x = angle - parameters.limp_home_deg;
    const double share = std::fmax(-1.0, std::fmin(1.0, x / parameters.preload_ramp_deg));
    return (above ? parameters.spring_above_nm_per_rad : parameters.spring_below_nm_per_rad) * rad(x) +
           (above ? parameters.preload_above_nm : parameters.preload_below_nm) * share;
  }
};

}  // namespace mgdd::test
