// The play operator (backlash of half width r): the output rests until the input pushes an end of the gap against it.
// Rate independent; input, output and r share one unit. noexcept, nothing allocated.
// The classical operator of hysteresis theory; its laws (rate independence, wiping out, width) stand in the tests.
#pragma once

#include "mgdd/math/select.hpp"

namespace mgdd::dynamics {

/// Next output of a play of half width `radius` whose output was `before`.
template <class T>
MGDD_INLINE T play(const T& input, const T& radius, const T& before) noexcept {
  return larger(input - radius, smaller(input + radius, before));
}

}  // namespace mgdd::dynamics
