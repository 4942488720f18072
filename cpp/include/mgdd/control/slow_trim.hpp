// A slow integral beside a predictive controller, for errors that its model does not explain: it grows only where the
// error is above the sensor's resolution and below a step, and its model must not see it, or would work against it.
// Angles in deg, duty -1..1, time in s. noexcept, heap-free.
#pragma once

#include <algorithm>
#include <cmath>

namespace mgdd::control {

inline constexpr double trim_from_deg = 0.08, trim_to_deg = 3.0, largest_trim = 0.25;

/// The trim after a sample; an error that is not finite leaves it.
template <class T>
T trimmed(T trim, T error_deg, double rate_per_deg_s, double sample_s) noexcept {
  const T size = std::abs(error_deg);
  if (!(size > T(trim_from_deg) && size < T(trim_to_deg))) return trim;
  return std::clamp(trim + T(rate_per_deg_s * sample_s) * error_deg, T(-largest_trim), T(largest_trim));
}

}  // namespace mgdd::control
