// What a controller and a supervisor believe of a throttle plate before it runs: gain and time constant, the limp-home
// springs and dry friction in duty, the travel; and the rows of their settings that name and check it. Angles in deg,
// duty -1..1, time in s.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/dynamics/limp_home_spring.hpp"

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

/// The springs as the duty that holds the plate against them.
struct HoldingDuty {
  double limp_home_deg = 8.0;
  double ramp_deg = 0.5;  ///< half width over which the preload changes its sign
  SpringSideDuty above{}, below{};

  bool operator==(const HoldingDuty&) const = default;

  template <class T>
  T at(const T& angle_deg) const noexcept {
    using Side = dynamics::SpringSide<T>;
    const auto load = dynamics::limp_home_spring(angle_deg - T(limp_home_deg), Side{T(above.per_deg), T(above.preload)},
                                                 Side{T(below.per_deg), T(below.preload)}, T(1.0 / ramp_deg));
    return load.elastic + load.preload;
  }
};

/// Defaults: the throttle P1.
struct Plate {
  double gain_deg_per_s2 = 83597.0;  ///< acceleration per duty
  double time_constant_s = 0.0197;   ///< of the speed
  double electrical_s = 1e-3;        ///< lag of the motor's torque; 0 for none
  HoldingDuty spring{};
  double friction = 0.0927;  ///< [-] dry friction of both directions
  double closed_deg = 0.0;
  double open_deg = 90.0;

  bool operator==(const Plate&) const = default;
};

// Rows of a `Plate` that stands at `Path` within the settings: `spring_fields<&PidSettings::plate>()`.

template <auto... Path>
constexpr auto motion_fields() {
  return std::array{
      field<Path..., &Plate::gain_deg_per_s2>(
          {"gain_deg_per_s2", "degree/second²", above(0.0, 1e9), "acceleration per duty"}),
      field<Path..., &Plate::time_constant_s>({"time_constant_s", "s", above(0.0, 1e9), "time constant of the speed"}),
  };
}

template <auto... Path>
constexpr auto spring_fields(std::string_view ramp = "half width over which the preload changes sides") {
  constexpr auto spring = &Plate::spring;
  using H = HoldingDuty;
  using Side = SpringSideDuty;
  constexpr Domain share = closed(0.0, 1.0);
  return std::array{
      field<Path..., spring, &H::limp_home_deg>(
          {"limp_home_deg", "deg", closed(-360.0, 360.0), "rest angle of the springs"}),
      field<Path..., spring, &H::ramp_deg>({"ramp_deg", "deg", above(0.0, 1e3), ramp}),
      field<Path..., spring, &H::above, &Side::preload>(
          {"preload_above", "-", share, "duty against the preload above limp-home"}),
      field<Path..., spring, &H::above, &Side::per_deg>(
          {"spring_above_per_deg", "1/degree", share, "duty against the spring above limp-home"}),
      field<Path..., spring, &H::below, &Side::preload>(
          {"preload_below", "-", share, "duty against the preload below limp-home"}),
      field<Path..., spring, &H::below, &Side::per_deg>(
          {"spring_below_per_deg", "1/degree", share, "duty against the spring below limp-home"}),
  };
}

template <auto... Path>
constexpr auto travel_fields() {
  constexpr Domain angle = closed(-1e3, 1e3);
  return std::array{
      field<Path..., &Plate::closed_deg>({"closed_deg", "deg", angle, "lower end of the travel"}),
      field<Path..., &Plate::open_deg>({"open_deg", "deg", angle, "upper end of the travel"}),
  };
}

/// All of it, as a predictive controller takes it.
template <auto... Path>
constexpr auto plate_fields() {
  return joined(motion_fields<Path...>(),
                std::array{field<Path..., &Plate::electrical_s>(
                    {"electrical_s", "s", closed(0.0, 1.0), "lag of the motor's torque"})},
                spring_fields<Path...>(),
                std::array{field<Path..., &Plate::friction>(
                    {"friction", "-", closed(0.0, 0.5), "duty against dry friction, at the start"})},
                travel_fields<Path...>());
}
inline constexpr auto plate_table = plate_fields();
inline auto fields_of(const Plate&) {
  return std::span(plate_table);
}

/// ParameterError naming field, value and bound.
inline void require_travel(const Plate& plate) {
  if (!(plate.closed_deg < plate.open_deg)) {
    fail(ParameterError("open_deg", plate.open_deg, "must be > closed_deg = " + text(plate.closed_deg), "deg"));
  }
}
inline void validate(const Plate& plate) {
  require_fields(plate_table, plate);
  require_travel(plate);
}

}  // namespace mgdd::control
