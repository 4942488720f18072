// The play operator (backlash of half width r): the output rests until the input pushes an end of the gap against it.
// Rate independent; input, output and r share one unit. noexcept, nothing allocated.
// Source: Brokate and Sprekels 1996, section 2.1.
#pragma once

#include "mgdd/common/dual_select.hpp"

namespace mgdd::throttle {

/// Next output of a play of half width `radius` whose output was `before`.
template <class T>
MGDD_INLINE T play(const T& input, const T& radius, const T& before) noexcept {
  return larger(input - radius, smaller(input + radius, before));
}

}  // namespace mgdd::throttle
