// Delay of a sampled signal by a number of samples, whole or not: between two held inputs the one that acts is their
// mean by time, which is what a delay that ends inside a sample does to a system slower than the sample. Part of a
// model's state; noexcept, heap-free.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "mgdd/math/select.hpp"

namespace mgdd::dynamics {

/// A delay split once: `whole` samples and the `fraction` of the next, in [0, 1).
struct Delay {
  int whole = 0;
  int reach = 0;  ///< samples until nothing of an input acts any more
  double fraction = 0.0;

  Delay() noexcept = default;
  explicit Delay(double samples) noexcept
      : whole(static_cast<int>(samples)), fraction(samples - static_cast<double>(whole)) {
    reach = fraction > 0.0 ? whole + 1 : whole;
  }
};

/// Inputs that were sent and may not act yet; `before[0]` is the last one. Holds delays of 0 to `n` samples: whoever
/// makes a `Delay` checks that.
template <class T, int n>
struct DelayLine {
  static constexpr int longest = n;
  std::array<T, static_cast<std::size_t>(n)> before{};

  /// Takes the newest input, gives the one that acts.
  MGDD_INLINE T pass(const T& newest, const Delay& delay) noexcept {
    if (delay.reach == 0) return newest;
    T acting = sent(newest, delay.whole);
    if (delay.fraction > 0.0) acting += T(delay.fraction) * (sent(newest, delay.whole + 1) - acting);
    push(newest, delay.reach);
    return acting;
  }

  /// What acts at a delay that is itself a parameter: piecewise linear in it, so that it has a derivative (at whole
  /// samples that towards a longer delay). The same number as `pass` gives.
  MGDD_INLINE T at(const T& newest, const T& delay) const noexcept {
    T acting = newest + delay * (before[0] - newest);
    for (std::size_t i = 1; i < before.size(); ++i) {
      const T samples = T(static_cast<double>(i));
      acting = select(delay < samples, acting, before[i - 1] + (delay - samples) * (before[i] - before[i - 1]));
    }
    return acting;
  }

  MGDD_INLINE void push(const T& newest, int length = n) noexcept {
    for (int i = length - 1; i > 0; --i)
      before[static_cast<std::size_t>(i)] = before[static_cast<std::size_t>(i - 1)];
    before[0] = newest;
  }
  void fill(const T& input) noexcept { before.fill(input); }

 private:
  MGDD_INLINE const T& sent(const T& newest, int samples_ago) const noexcept {
    // NOLINTNEXTLINE(bugprone-return-const-ref-from-parameter): the caller holds `newest`
    return samples_ago == 0 ? newest : before[static_cast<std::size_t>(samples_ago - 1)];
  }
};

}  // namespace mgdd::dynamics
