// What the three pseudo-Wiener models share: travel, sampling, delay line, the pair of lags, and how a measurement
// re-anchors them. Units: deg, s, duty. Everything here is noexcept and allocation-free but the desk-time checks.
#pragma once

#include <array>
#include <cstddef>

#include "mgdd/math/select.hpp"

namespace mgdd::throttle {

inline constexpr int max_delay_samples = 5;

/// Where the lags of PW-W and PW-P stand when a free run starts at a measured angle.
enum class LagStart {
  rest,         ///< settled at zero duty: for a record that starts at limp-home
  inverse_map,  ///< settled where the map gives the angle
};

/// Sampling and travel: set, not fitted.
struct PseudoWienerFrame {
  double closed_deg = 0.0;
  double open_deg = 90.0;
  double sample_s = 1e-3;  ///< the duty is held that long
  int substeps = 2;        ///< steps of PW-R per sample; the two others are exact for a held duty
  int delay_samples = 0;   ///< d: computing and sampling delay, 0..5

  bool operator==(const PseudoWienerFrame&) const = default;

  /// ParameterError naming field, value and bound.
  void validate() const;
};

/// How a measured angle corrects a model, per sample of 1 ms; for other samples the caller scales.
struct Anchor {
  double angle_gain = 0.35;               ///< l1: 1 is a full reset, 0 a free run
  double speed_gain_per_s = 35.0;         ///< l2 (PW-R)
  double bias_gain_duty_per_deg = 0.004;  ///< l3 (PW-R)
  double bias_limit_duty = 0.4;
  double offset_gain = 1.0;  ///< PW-W, PW-P: share of the error that moves the output offset

  bool operator==(const Anchor&) const = default;

  void validate() const;
};

/// The duties that have been sent and do not act yet; `before[0]` is the last one.
template <class T>
struct DelayLine {
  std::array<T, static_cast<std::size_t>(max_delay_samples)> before{};

  /// Takes the newest duty, gives the one of `delay` samples ago.
  MGDD_INLINE T pass(const T& duty, int delay) noexcept {
    if (delay == 0) return duty;
    const T acting = before[static_cast<std::size_t>(delay - 1)];
    for (int i = delay - 1; i > 0; --i)
      before[static_cast<std::size_t>(i)] = before[static_cast<std::size_t>(i - 1)];
    before[0] = duty;
    return acting;
  }
  void fill(const T& duty) noexcept { before.fill(duty); }
};

/// Two first-order lags in a row with unit DC gain, exact for a held input.
template <class T>
struct LagPair {
  T first_share{1.0};  ///< 1 - exp(-sample/tau)
  T second_share{1.0};

  LagPair() noexcept = default;
  LagPair(const T& first_s, const T& second_s, double sample_s) noexcept
      : first_share(T(1.0) - exp_of(T(-sample_s) / first_s)), second_share(T(1.0) - exp_of(T(-sample_s) / second_s)) {}

  MGDD_INLINE void step(T& first, T& second, const T& input) const noexcept {
    first += first_share * (input - first);
    second += second_share * (first - second);
  }
};

}  // namespace mgdd::throttle
