// Made-up samples for the supervisor of a throttle controller, and settings that nothing else has.
#pragma once

#include "mgdd/control/supervisor.hpp"
#include "support/test.hpp"

namespace mgdd::control {

using Mode = SupervisorMode;
using Reason = SupervisorReason;
inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Both sides of limp-home different, odd thresholds.
inline SupervisorSettings lively() {
  SupervisorSettings s;
  s.plate.closed_deg = 1.0;
  s.plate.open_deg = 84.0;
  s.limited_open_deg = 35.0;
  s.plate.spring.limp_home_deg = 11.0;
  s.plate.spring.above = {.preload = 0.13, .per_deg = 6e-4};
  s.plate.spring.below = {.preload = 0.17, .per_deg = 9e-4};
  return s;
}

inline SupervisorInputs at(double angle_deg, double reference_deg) {
  return {.reference_deg = reference_deg, .angle_deg = {angle_deg, angle_deg}, .supply_v = 12.0};
}
inline SupervisorInputs at(double angle_deg) {
  return at(angle_deg, angle_deg);
}

/// One sample of a plate that is held where it is.
inline SupervisorOrder hold(ThrottleSupervisor& s, const SupervisorInputs& in) {
  const SupervisorView view = s.observe(in);
  return s.decide(s.settings().plate.spring.at(view.angle_deg));
}
inline void settle(ThrottleSupervisor& s, double angle_deg, int samples = 100) {
  for (int k = 0; k < samples; ++k)
    ASSERT_EQ(hold(s, at(angle_deg)).mode, Mode::normal) << k;
}

/// Samples of these inputs until the bridge opens; -1 if it does not within 3 s.
inline int opens_after(ThrottleSupervisor& s, const SupervisorInputs& in, Reason reason) {
  for (int k = 1; k <= 3000; ++k) {
    const SupervisorOrder order = hold(s, in);
    if (order.bridge_open) {
      EXPECT_EQ(order.mode, Mode::limp_home);
      EXPECT_EQ(order.duty, 0.0);
      EXPECT_EQ(order.reason, reason);
      return k;
    }
  }
  return -1;
}

}  // namespace mgdd::control
