// What the throttle models that run in real time share: travel, sampling, delay, and the gains of their observer.
// Units: deg, s, duty.
#pragma once

#include <array>
#include <cstddef>

#include "mgdd/dynamics/delay_line.hpp"
#include "mgdd/dynamics/lag.hpp"

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
  double sample_s = 1e-3;      ///< the duty is held that long
  int substeps = 2;            ///< steps of PW-R per sample; the two others are exact for a held duty
  double delay_samples = 0.0;  ///< d: computing and sampling delay, 0..5, whole or not

  bool operator==(const PseudoWienerFrame&) const = default;

  /// ParameterError naming field, value and bound.
  void validate() const;
  /// For another sample time: the delay keeps its seconds. ParameterError when the line would be too short for it.
  PseudoWienerFrame at_sample(double new_sample_s) const;
  dynamics::Delay delay() const noexcept { return dynamics::Delay(delay_samples); }
};

/// How a measured angle corrects a model, per sample of 1 ms; for other samples the caller scales.
struct ObserverGains {
  double angle_gain = 0.35;               ///< l1: 1 is a full reset, 0 a free run
  double speed_gain_per_s = 35.0;         ///< l2 (models with a speed)
  double bias_gain_duty_per_deg = 0.004;  ///< l3 (models with a speed)
  double bias_limit_duty = 0.4;
  double offset_gain = 1.0;  ///< PW-W, PW-P: share of the error that moves the output offset

  bool operator==(const ObserverGains&) const = default;

  void validate() const;
};

/// Position, speed and bias after a correction by `error`, measured minus predicted position.
template <class T>
MGDD_INLINE void pull(T& position, T& speed, T& bias, const T& error, const ObserverGains& gains) noexcept {
  const T limit = T(gains.bias_limit_duty);
  position += T(gains.angle_gain) * error;
  speed += T(gains.speed_gain_per_s) * error;
  bias = larger(smaller(bias - T(gains.bias_gain_duty_per_deg) * error, limit), -limit);
}

/// For on-line code whose parameters were checked before: makes a model without another check.
struct Unchecked {};
inline constexpr Unchecked unchecked{};

/// The delay of the frame and the line that it needs.
template <class T>
using DutyLine = dynamics::DelayLine<T, max_delay_samples>;
using dynamics::LagPair;

}  // namespace mgdd::throttle
