// Faults of a throttle in the loop beside those of its sensors (throttle/sensors.hpp): the plate, its springs, its
// supply, and the way of a measurement to the controller. Angles in deg, volts, seconds. What acts during a run is
// noexcept and allocation-free; checks are offline code.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/throttle/plant.hpp"

namespace mgdd::loop {

enum class ThrottleFaultKind {
  jammed,          ///< plate and gear stay where they are
  jammed_at,       ///< they catch when the plate comes to `size` [deg]
  spring_above,    ///< the spring above limp-home loses the share `size` [-] of preload and stiffness; 1: it is broken
  spring_below,    ///< the same below
  supply_sag,      ///< the bridge has `size` [V] at most
  missing_sample,  ///< no measurement arrives
  nan_sample,      ///< one arrives, and its numbers are NaN
  stale_sample,    ///< the last good one arrives again
};

/// What goes wrong, during the samples that begin in [from_s, until_s).
struct ThrottleFault {
  ThrottleFaultKind kind = ThrottleFaultKind::jammed;
  double from_s = 0.0;
  double size = 0.0;                ///< as its kind says; 0 where it says nothing
  std::optional<double> until_s{};  ///< none: it stays
};
/// ParameterError naming field, value and bound.
void validate(const ThrottleFault& fault);

/// The samples of a fault, first included, end not.
struct FaultSamples {
  std::int64_t first, end;

  bool contains(std::int64_t sample) const noexcept { return first <= sample && sample < end; }
};
FaultSamples samples_of(const ThrottleFault& fault, double sample_s) noexcept;

/// The plant while a fault of plate or spring acts; others leave it as it is.
void apply(const ThrottleFault& fault, throttle::Throttle& throttle) noexcept;

/// Dry friction of a jammed plate [N m]: stops any plate within one step.
inline constexpr double jam_nm = 1e9;

}  // namespace mgdd::loop
