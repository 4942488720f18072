// The check of one number against a closed interval, with the message that all rooms share.
#pragma once

#include <string>
#include <string_view>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd {

/// ParameterError `name = value unit: must be in [lower, upper]`; NaN is refused too.
inline void require_within(std::string_view name, double value, double lower, double upper,
                           std::string_view unit = "") {
  if (value >= lower && value <= upper) return;
  throw ParameterError(name, value, "must be in [" + text(lower) + ", " + text(upper) + "]", unit);
}

/// ParameterError `name = value unit: must be > 0 and finite`.
inline void require_positive(std::string_view name, double value, std::string_view unit = "") {
  if (value > 0.0 && value <= 1e300) return;
  throw ParameterError(name, value, "must be > 0 and finite", unit);
}

}  // namespace mgdd
