// What all controllers of a plate are told alike: bounds of the duty, and how the rate of the reference is taken. Their
// rows of the settings, and their checks, are offline code.
#pragma once

#include <algorithm>
#include <array>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/record.hpp"

namespace mgdd::control {

struct DutyRange {
  double lower = -1.0;
  double upper = 1.0;

  bool operator==(const DutyRange&) const = default;

  template <class T>
  T clamp(const T& duty) const noexcept {
    return std::clamp(duty, T(lower), T(upper));
  }
};

/// ParameterError unless the bounds differ.
inline void validate(const DutyRange& duty) {
  if (!(duty.lower < duty.upper)) fail(ParameterError("upper", duty.upper, "must be > lower = " + text(duty.lower)));
}
/// ParameterError for a restored duty outside its bounds.
template <class T>
void require_usable_duty(const T& duty, const DutyRange& range) {
  require_within("state column 'duty'", static_cast<double>(duty), static_cast<double>(T(range.lower)),
                 static_cast<double>(T(range.upper)));
}

/// Rows of a `DutyRange` that stands at `place` within the settings.
template <auto place>
constexpr auto duty_fields() {
  return std::array{
      field<place, &DutyRange::lower>({"lower", "-", closed(-1.0, 0.0), "least duty"}),
      field<place, &DutyRange::upper>({"upper", "-", closed(0.0, 1.0), "largest duty"}),
  };
}

struct ReferenceRate {
  double lag_s = 4.5e-3;
  double jump_deg_per_s = 400.0;  ///< a faster reference steps: it has no rate

  bool operator==(const ReferenceRate&) const = default;
};

template <auto place>
constexpr auto reference_fields() {
  return std::array{
      field<place, &ReferenceRate::lag_s>(
          {"reference_lag_s", "s", closed(0.0, 10.0), "lag of the rate of the reference"}),
      field<place, &ReferenceRate::jump_deg_per_s>(
          {"reference_jump_deg_per_s", "degree/second", above(0.0, 1e9), "a faster reference steps and has no rate"}),
  };
}

}  // namespace mgdd::control
