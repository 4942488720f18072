// Which numbers a parameter may take, and the check of one number with the message that all rooms share.
#pragma once

#include <string>
#include <string_view>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd {

inline constexpr double unbounded = 1e300;  ///< finite, so that infinity itself lies outside

/// An interval of numbers; NaN lies outside of every one.
struct Domain {
  double lower = -unbounded;
  double upper = unbounded;
  bool lower_open = false;  ///< `lower` itself lies outside
  bool upper_open = false;
  bool log_scaled = false;  ///< a search moves the logarithm; needs lower > 0

  constexpr bool contains(double value) const noexcept {
    return (lower_open ? value > lower : value >= lower) && (upper_open ? value < upper : value <= upper);
  }
  /// The nearest number between the bounds.
  constexpr double clamped(double value) const noexcept {
    return value < lower ? lower : upper < value ? upper : value;
  }
};

/// [lower, upper]
constexpr Domain closed(double lower, double upper) noexcept {
  return {.lower = lower, .upper = upper};
}
/// (lower, upper]
constexpr Domain above(double lower, double upper = unbounded) noexcept {
  return {.lower = lower, .upper = upper, .lower_open = true};
}
/// [lower, upper], searched as a logarithm.
constexpr Domain log_scale(double lower, double upper) noexcept {
  return {.lower = lower, .upper = upper, .log_scaled = true};
}

/// "must be in [0, 1]", "must be > 0 and <= 20", "must be > 0 and finite".
inline std::string requirement(const Domain& d) {
  const bool from_below = d.lower > -unbounded, from_above = d.upper < unbounded;
  if (from_below && from_above && !d.lower_open && !d.upper_open) {
    return "must be in [" + text(d.lower) + ", " + text(d.upper) + "]";
  }
  std::string sides;
  if (from_below) sides += (d.lower_open ? "> " : ">= ") + text(d.lower) + " and ";
  return "must be " + sides + (from_above ? (d.upper_open ? "< " : "<= ") + text(d.upper) : "finite");
}

/// ParameterError `name = value unit: requirement`.
inline void require_in(const Domain& domain, std::string_view name, double value, std::string_view unit = "") {
  if (!domain.contains(value)) fail(ParameterError(name, value, requirement(domain), unit));
}
inline void require_within(std::string_view name, double value, double lower, double upper,
                           std::string_view unit = "") {
  require_in(closed(lower, upper), name, value, unit);
}
inline void require_positive(std::string_view name, double value, std::string_view unit = "") {
  require_in(above(0.0), name, value, unit);
}

}  // namespace mgdd
