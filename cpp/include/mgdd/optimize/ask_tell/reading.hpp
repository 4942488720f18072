// Which numbers count as a measurement: finite and at most 1e30 in magnitude. No physical quantity comes near that
// bound, instruments that report overload as 9.9e37 (SCPI) or as the largest double lie beyond it, and squares and
// products of what lies within it stay far from the end of the doubles.
#pragma once

namespace mgdd::optimize {

inline constexpr double largest_reading = 1e30;
inline constexpr double unread = 1e300;  ///< where nothing was read; a state does not hold NaN

/// False for NaN too.
constexpr bool is_reading(double value) noexcept {
  return value >= -largest_reading && value <= largest_reading;
}

}  // namespace mgdd::optimize
