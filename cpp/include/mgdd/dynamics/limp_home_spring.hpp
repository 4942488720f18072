// The limp-home spring: two springs with preload that pull the plate to one angle, each with its own stiffness and
// preload. The preload changes its sign over a ramp (linear, or tanh for optimisers). Torque and angle in the unit of
// the model; positive when it closes. noexcept, heap-free.
#pragma once

#include <type_traits>

#include "mgdd/math/select.hpp"

namespace mgdd::dynamics {

template <class C>
struct SpringSide {
  C stiffness, preload;
};

/// Share of the preload at a distance of `ratio` ramps from limp-home.
template <class T>
MGDD_INLINE T linear_share(const T& ratio) noexcept {
  return larger(smaller(ratio, T(1.0)), T(-1.0));
}

/// Torque at x from limp-home, in two parts because schemes round them apart, and its slope.
template <class T, class C>
struct SpringLoad {
  T elastic;         ///< stiffness x
  T preload;         ///< preload times its share
  C stiffness;       ///< of the spring
  C ramp_stiffness;  ///< of the ramp, zero outside
};

/// The spring of one side of limp-home, `share` of its preload acting.
template <class T, class C>
MGDD_INLINE SpringLoad<T, C> spring_of_side(const T& x, const T& share, const C& stiffness, const C& preload,
                                            const C& ramp_stiffness) noexcept {
  return {stiffness * x, preload * share, stiffness, ramp_stiffness};
}

/// The spring with the linear ramp, half width 1/over_ramp.
template <class T, class C>
MGDD_INLINE SpringLoad<T, C> limp_home_spring(const T& x, const SpringSide<C>& upper, const SpringSide<C>& lower,
                                              const C& over_ramp) noexcept {
  if constexpr (!std::is_floating_point_v<T> && std::is_same_v<decltype(x < T(0.0)), bool>) {
    // A number with derivatives: a branch spares those of minimum and maximum.
    const bool up = !(x < T(0.0));
    const SpringSide<C>& side = up ? upper : lower;
    const T ratio = x * over_ramp;
    if (T(1.0) < ratio || ratio < T(-1.0)) {
      return spring_of_side(x, up ? T(1.0) : T(-1.0), side.stiffness, side.preload, C(0.0));
    }
    return spring_of_side(x, ratio, side.stiffness, side.preload, C(side.preload * over_ramp));
  }
  const auto above = x >= T(0.0);
  const C stiffness = select(above, upper.stiffness, lower.stiffness);
  const C preload = select(above, upper.preload, lower.preload);
  const T ratio = x * over_ramp;
  const T share = linear_share(ratio);
  return spring_of_side(x, share, stiffness, preload, select(share == ratio, preload * over_ramp, C(0.0)));
}

}  // namespace mgdd::dynamics
