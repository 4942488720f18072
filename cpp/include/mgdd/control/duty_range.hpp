// Bounds of a controller's duty: checks shared by the controllers. Offline code.
#pragma once

#include "mgdd/common/bounds.hpp"

namespace mgdd::control {

inline constexpr Domain lower_duty = closed(-1.0, 0.0);
inline constexpr Domain upper_duty = closed(0.0, 1.0);

/// ParameterError unless the bounds differ.
inline void require_duty_range(double lower, double upper) {
  if (!(lower < upper)) throw ParameterError("upper", upper, "must be > lower = " + text(lower));
}

/// ParameterError for a restored duty outside its bounds.
template <class T>
void require_usable_duty(T duty, double lower, double upper) {
  require_within("state column 'duty'", static_cast<double>(duty), static_cast<double>(T(lower)),
                 static_cast<double>(T(upper)));
}

}  // namespace mgdd::control
