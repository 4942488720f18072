// Logarithmic factors on the five groups of PW-R, both sides alike, for on-line searches: q = 0 is the start.
// The groups are tau, G, G beta, G kappa and G delta: the last three are torques over the inertia, which a change of
// supply or winding resistance leaves alone. noexcept, allocation-free.
#pragma once

#include <array>
#include <cstddef>

#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::identify {

/// `base` with each group times exp(factor); over a Dual, lane i carries d/d factor i.
template <class T, class Factors>
throttle::BasicPwR<T> with_factors(const throttle::PwR& base, const Factors& factors) noexcept {
  auto p = throttle::lift<T>(base);
  std::array<T, 5> q{T(0.0), T(0.0), T(0.0), T(0.0), T(0.0)};
  for (std::size_t i = 0; i < q.size(); ++i) {
    q[i] = T(factors[static_cast<int>(i)]);
    if constexpr (is_dual_v<T>) q[i].grad[i] = 1.0;
  }
  for (auto* side : {&p.above, &p.below}) {
    side->tau_s = side->tau_s * exp_of(q[0]);
    side->gain_deg_per_s2_per_duty = side->gain_deg_per_s2_per_duty * exp_of(q[1]);
    side->preload_duty = side->preload_duty * exp_of(q[2] - q[1]);
    side->spring_duty_per_deg = side->spring_duty_per_deg * exp_of(q[3] - q[1]);
    side->coulomb_duty = side->coulomb_duty * exp_of(q[4] - q[1]);
  }
  return p;
}

/// Inside the bounds of `throttle::fields`.
throttle::PwR bounded(throttle::PwR parameters) noexcept;

}  // namespace mgdd::identify
