// Learns, sample by sample, what a plate's prediction gets wrong: two levels of dry friction per side of limp-home, one
// for opening and one for closing, the gain and the damping. While the plate slides they follow the innovation of the
// observer along its own sensitivities (recursive prediction error method, Ljung and Söderström 1983, chapter 3), with
// a covariance that learning narrows and time widens again to where it began; while it should stick but moves, the
// level is what pushed it, at most. Every step is bounded, every number confined. Angles in deg, duty -1..1, time in s.
// noexcept, heap-free.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/plate_model.hpp"

namespace mgdd::control {

inline constexpr double least_damping_factor = 0.4;
inline constexpr double largest_damping_factor = 2.5;
/// Duty beyond the friction level, or taken by the speed, from which gain and damping are learnt.
inline constexpr double least_excitation = 0.08;

/// A sample that lasts longer teaches no more: one innovation says what it says, however long it took.
inline constexpr double longest_lesson_s = 1e-3;

struct FrictionLearnerSettings {
  double rate_per_s = 150.0;     ///< share of what explains an innovation that is learnt, per time up to 1 ms
  double gain_weight = 36.0;     ///< variance of the gain factor at the start, over that of a level in duty
  double damping_weight = 36.0;  ///< of the damping factor
  double level_memory_s = 0.01;  ///< time of sliding after which a level is as uncertain as at the start
  double memory_s = 0.5;         ///< the same for gain and damping
  double least_gain_factor = 0.625;
  double largest_gain_factor = 1.6;

  bool operator==(const FrictionLearnerSettings&) const = default;
};

/// What one step of the observer says about a sliding plate.
template <class T>
struct Slide {
  T push;     ///< duty beyond the springs
  T speed;    ///< after the step
  T divisor;  ///< of the step
};

template <class T>
class FrictionLearner {
 public:
  /// `angle_share` and `speed_gain` of the observer's correction; `noise_deg` of the measured angle bounds a step.
  FrictionLearner(const FrictionLearnerSettings& s, const Plate& plate, double sample_s, double noise_deg,
                  T angle_share, T speed_gain) noexcept
      : rate_(T(std::fmin(s.rate_per_s * std::fmin(sample_s, longest_lesson_s), 1.0))),
        prior_{T(1.0), T(s.gain_weight), T(s.damping_weight)},
        level_fades_(T(std::fmin(sample_s / s.level_memory_s, 1.0))),
        fades_(T(std::fmin(sample_s / s.memory_s, 1.0))),
        least_gain_(T(s.least_gain_factor)),
        largest_gain_(T(s.largest_gain_factor)),
        sample_(T(sample_s)),
        step_gain_(T(sample_s * plate.gain_deg_per_s2)),
        step_decay_(T(sample_s / plate.time_constant_s)),
        angle_share_(angle_share),
        speed_gain_(speed_gain),
        stuck_rate_(T(20.0 * sample_s)),
        largest_error_(T(10.0 * noise_deg)),
        threshold_(T(3.3 * noise_deg)),
        least_friction_(T(0.3 * plate.friction)) {
    reset();
  }

  /// The plate slides.
  void slide(PlateBelief<T>& belief, FrictionBand<T>& band, T innovation, const Slide<T>& now) noexcept {
    const T sign = now.speed > T(0.0) ? T(1.0) : T(-1.0);
    const T gain = step_gain_ * belief.gain_factor;
    const T braking = step_decay_ * now.speed;  // of a factor 1, as a change of speed
    const std::array<T, 3> drive{
        -gain, step_gain_ * (now.push - band.bias - sign * band.friction) - belief.damping_factor * braking,
        -belief.gain_factor * braking};
    for (std::size_t i = 0; i < drive.size(); ++i) {
      speed_slope_[i] = (speed_slope_[i] + drive[i]) / now.divisor;
      angle_slope_[i] += sample_ * speed_slope_[i];
    }
    const auto& v = covariance_;
    const auto& a = angle_slope_;
    const std::array<T, 3> spread{v[0] * a[0] + v[1] * a[1] + v[2] * a[2], v[1] * a[0] + v[3] * a[1] + v[4] * a[2],
                                  v[2] * a[0] + v[4] * a[1] + v[5] * a[2]};
    const T size = T(1.0) + a[0] * spread[0] + a[1] * spread[1] + a[2] * spread[2];
    const T error = rate_ * std::clamp(innovation, -largest_error_, largest_error_) / size;
    const T level = error * spread[0];
    // Gain and damping only where they show: a slow plate says nothing about them, and they would drift.
    const T shown = T(least_excitation) * std::abs(a[0]);
    if (std::abs(a[1]) > shown) {
      belief.gain_factor = std::clamp(belief.gain_factor + error * spread[1], least_gain_, largest_gain_);
    }
    if (std::abs(a[2]) > shown) {
      belief.damping_factor =
          std::clamp(belief.damping_factor + error * spread[2], T(least_damping_factor), T(largest_damping_factor));
    }
    narrow(spread, size);
    // The level of this direction moves by the step, that of the other one by a quarter of it.
    band.bias += T(0.625) * level;
    band.friction += T(0.375) * sign * level;
    confine(band);
    for (std::size_t i = 0; i < drive.size(); ++i) {
      speed_slope_[i] -= speed_gain_ * angle_slope_[i];
      angle_slope_[i] -= angle_share_ * angle_slope_[i];
    }
  }

  /// The plate should stick; two innovations in a row beyond the noise say that it moves. Gives the speed that they
  /// mean, or 0.
  T stick(FrictionBand<T>& band, T innovation, T last_innovation, T push) noexcept {
    forget();
    const T sign = innovation > T(0.0) ? T(1.0) : T(-1.0);
    if (!(sign * innovation > threshold_ && sign * last_innovation > threshold_)) return T(0.0);
    if (sign * (push - band.bias) > T(0.0)) {
      const T other = band.bias - sign * band.friction;
      const T level = sign * std::min(sign * band.bias + band.friction, sign * push - T(0.005));
      band.bias = T(0.5) * (level + other);
      band.friction = T(0.5) * sign * (level - other);
    } else {
      band.bias -= stuck_rate_ * innovation;
    }
    confine(band);
    return T(200.0) * innovation;
  }

  /// Nothing of the past explains the next innovation.
  void forget() noexcept {
    angle_slope_.fill(T(0.0));
    speed_slope_.fill(T(0.0));
  }

  /// Nothing is learnt.
  void reset() noexcept {
    forget();
    covariance_ = {prior_[0], T(0.0), T(0.0), prior_[1], T(0.0), prior_[2]};
  }

  /// Whether a restored covariance can be one of these settings.
  bool is_usable() const noexcept {
    const auto within = [](T value, T most) { return value >= T(0.0) && value <= most * T(1.0 + 1e-6); };
    return within(covariance_[0], prior_[0]) && within(covariance_[3], prior_[1]) && within(covariance_[5], prior_[2]);
  }

  template <class Self, class V>
  static void visit(Self& self, V&& v) {
    constexpr std::array<const char*, 6> names{"level_angle", "gain_angle", "damping_angle",
                                               "level_speed", "gain_speed", "damping_speed"};
    for (std::size_t i = 0; i < 3; ++i) {
      visit_number(v, names[i], self.angle_slope_[i]);
      visit_number(v, names[i + 3], self.speed_slope_[i]);
    }
    constexpr std::array<const char*, 6> variances{"level_variance", "level_gain",   "level_damping",
                                                   "gain_variance",  "gain_damping", "damping_variance"};
    for (std::size_t i = 0; i < variances.size(); ++i)
      visit_number(v, variances[i], self.covariance_[i]);
  }

 private:
  // What was learnt narrows the covariance by the learnt share; then it fades to the first one. Both keep it positive:
  // the fading shares form a Schur product with a positive matrix.
  void narrow(const std::array<T, 3>& spread, T size) noexcept {
    const T share = rate_ / size;
    std::size_t at = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const T fades = i == 0 ? level_fades_ : fades_;
      for (std::size_t j = i; j < 3; ++j, ++at) {
        const T narrowed = covariance_[at] - share * spread[i] * spread[j];
        covariance_[at] = narrowed + fades * ((i == j ? prior_[i] : T(0.0)) - narrowed);
      }
    }
  }

  void confine(FrictionBand<T>& band) const noexcept {
    band.friction = std::clamp(band.friction, least_friction_, largest_level);
    const T room = largest_level - band.friction;
    band.bias = std::clamp(band.bias, -room, room);
  }

  static constexpr T largest_level{0.5};
  T rate_;
  std::array<T, 3> prior_;  // variances
  T level_fades_, fades_;
  T least_gain_, largest_gain_, sample_, step_gain_, step_decay_, angle_share_, speed_gain_;
  T stuck_rate_, largest_error_, threshold_, least_friction_;
  // Of the predicted angle and speed to the level of the present direction, gain factor and damping factor.
  std::array<T, 3> angle_slope_{}, speed_slope_{};
  std::array<T, 6> covariance_{};  // of these three, upper triangle by rows, over the variance of an innovation
};

}  // namespace mgdd::control
