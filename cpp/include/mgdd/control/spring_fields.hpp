// Fields of the limp-home springs as the settings of every controller and of the supervisor name and check them.
// Offline code.
#pragma once

#include <array>
#include <string_view>

#include "mgdd/common/record.hpp"
#include "mgdd/control/holding_duty.hpp"

namespace mgdd::control {

/// Rows of a `HoldingDuty` that stands at `Path` within the settings: `spring_fields<&PidSettings::spring>()`.
template <auto... Path>
constexpr auto spring_fields(std::string_view ramp = "half width over which the preload changes sides") {
  using H = HoldingDuty;
  using Side = SpringSideDuty;
  constexpr Domain share = closed(0.0, 1.0);
  return std::array{
      field<Path..., &H::limp_home_deg>({"limp_home_deg", "deg", closed(-360.0, 360.0), "rest angle of the springs"}),
      field<Path..., &H::ramp_deg>({"ramp_deg", "deg", above(0.0, 1e3), ramp}),
      field<Path..., &H::above, &Side::preload>(
          {"preload_above", "-", share, "duty against the preload above limp-home"}),
      field<Path..., &H::above, &Side::per_deg>(
          {"spring_above_per_deg", "1/degree", share, "duty against the spring above limp-home"}),
      field<Path..., &H::below, &Side::preload>(
          {"preload_below", "-", share, "duty against the preload below limp-home"}),
      field<Path..., &H::below, &Side::per_deg>(
          {"spring_below_per_deg", "1/degree", share, "duty against the spring below limp-home"}),
  };
}

}  // namespace mgdd::control
