// Duty that holds a plate against its limp-home spring, as a controller knows it: preload and slope of each side in
// duty, the preload ramped through limp-home. Angles in deg, duty -1..1. noexcept, heap-free.
#pragma once

#include <algorithm>

namespace mgdd::control {

/// A value in widths, limited to -1..1.
template <class T>
T limited_share(const T& value, const T& width) noexcept {
  return std::clamp(value / width, T(-1.0), T(1.0));
}

struct SpringSideDuty {
  double preload = 0.1292;  ///< [-] P1: T_pt R/(K V)
  double per_deg = 4.96e-4;

  bool operator==(const SpringSideDuty&) const = default;
};

struct HoldingDuty {
  double limp_home_deg = 8.0;
  double ramp_deg = 0.5;  ///< half width over which the preload changes its sign
  SpringSideDuty above{}, below{};

  bool operator==(const HoldingDuty&) const = default;

  template <class T>
  T at(const T& angle_deg) const noexcept {
    const T x = angle_deg - T(limp_home_deg);
    const SpringSideDuty& side = x < T(0.0) ? below : above;
    return T(side.per_deg) * x + T(side.preload) * limited_share(x, T(ramp_deg));
  }
};

}  // namespace mgdd::control
