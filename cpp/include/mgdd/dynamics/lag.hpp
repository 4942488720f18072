// First-order lags, exact for an input held over the sample: y += share (u - y), share = 1 - exp(-sample/tau).
// noexcept, heap-free.
#pragma once

#include "mgdd/math/select.hpp"

namespace mgdd::dynamics {

/// Share of the way to its input that a lag of `tau_s` goes in one sample.
template <class C>
C lag_share(const C& tau_s, double sample_s) noexcept {
  return C(1.0) - exp_of(C(-sample_s) / tau_s);
}

/// Two lags in a row with unit DC gain.
template <class C>
struct LagPair {
  C first_share{1.0};
  C second_share{1.0};

  LagPair() noexcept = default;
  LagPair(const C& first_s, const C& second_s, double sample_s) noexcept
      : first_share(lag_share(first_s, sample_s)), second_share(lag_share(second_s, sample_s)) {}

  template <class T>
  MGDD_INLINE void step(T& first, T& second, const T& input) const noexcept {
    first += first_share * (input - first);
    second += second_share * (first - second);
  }
};

}  // namespace mgdd::dynamics
