// A throttle plate as a predictive controller believes it: gain and time constant, springs in duty, an electrical lag,
// and dry friction as two levels per side of limp-home, one for opening and one for closing. Fulfils
// `dynamics::DiscreteModel`. Angles in deg, duty -1..1, time in s. Steps are noexcept and heap-free, on any scalar.
// Scheme: the proximal step of dynamics/dry_friction.hpp (Moreau 1988); the lag is exact for a held duty.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "mgdd/control/plate.hpp"
#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/dry_friction.hpp"

namespace mgdd::control {

/// Dry friction of one side of limp-home: the plate opens against `bias + friction`, closes against `bias - friction`.
template <class C>
struct FrictionBand {
  C bias{0.0};
  C friction{0.0};
};

/// What is learnt while a controller runs.
template <class C>
struct PlateBelief {
  FrictionBand<C> above{}, below{};
  C gain_factor{1.0};
  C damping_factor{1.0};  ///< of the speed's decay, beside the gain's: back-EMF scales with both
};

/// How dry friction enters a prediction.
enum class PlateFriction {
  set_valued,  ///< sticks exactly; no gradient while the plate is stuck
  creeping,    ///< tanh of the speed: a gradient everywhere
  none,        ///< only its bias, and no stops: for a linear prediction
};

template <class T>
struct PlateState {
  T angle_deg{0.0};
  T speed_deg_per_s{0.0};
  T torque{0.0};  ///< of the motor over stall torque, as a duty
};

template <class T, class C = T>
class PlateModel {
 public:
  using Scalar = T;
  using State = PlateState<T>;
  using Input = T;
  static constexpr int n_observed = 2;

  PlateModel(const Plate& s, double sample_s, PlateFriction form, double creep_deg_per_s = 40.0) noexcept
      : sample_s_(sample_s), form_(form) {
    const double lags = s.electrical_s > 0.0 ? sample_s / s.electrical_s : 1e9;
    const double decay = std::exp(-lags);
    c_ = {.limp_home = C(s.spring.limp_home_deg),
          .over_ramp = C(1.0 / s.spring.ramp_deg),
          .above = {C(s.spring.above.per_deg), C(s.spring.above.preload)},
          .below = {C(s.spring.below.per_deg), C(s.spring.below.preload)},
          .decay = C(decay),
          .mean_share = C((1.0 - decay) / lags),
          .step = C(sample_s),
          .step_gain = C(sample_s * s.gain_deg_per_s2),
          .decay_share = C(sample_s / s.time_constant_s),
          .over_creep = C(1.0 / creep_deg_per_s),
          .closed = C(s.closed_deg),
          .open = C(s.open_deg)};
    believe({{C(0.0), C(s.friction)}, {C(0.0), C(s.friction)}, C(1.0), C(1.0)});
  }

  void believe(const PlateBelief<C>& belief) noexcept {
    belief_ = belief;
    gain_ = c_.step_gain * belief.gain_factor;
    damped_ = C(1.0) + c_.decay_share * belief.gain_factor * belief.damping_factor;
  }
  const PlateBelief<C>& belief() const noexcept { return belief_; }
  /// What divides the momentum of a step beside the springs.
  C damped() const noexcept { return damped_; }
  /// From now on the spring of one side acts everywhere, without a ramp.
  void freeze_side(bool above) noexcept { frozen_ = above ? 1 : -1; }

  /// Mean of the lagged duty over a step under a held one.
  MGDD_INLINE T mean_torque(const State& s, const T& duty) const noexcept {
    return duty + c_.mean_share * (s.torque - duty);
  }

  MGDD_INLINE void step(State& s, const T& duty) const noexcept {
    const T acting = mean_torque(s, duty);
    s.torque = duty + c_.decay * (s.torque - duty);
    const T x = s.angle_deg - T(c_.limp_home);
    const bool up = frozen_ == 0 ? !(x < T(0.0)) : frozen_ > 0;
    const FrictionBand<C>& band = up ? belief_.above : belief_.below;
    const auto spring = load(x, up);
    const C divisor = damped_ + c_.step * gain_ * (spring.stiffness + spring.ramp_stiffness);
    const T drive = s.speed_deg_per_s + T(gain_) * (acting - (spring.elastic + spring.preload) - T(band.bias));
    const C level = gain_ * band.friction;
    T next(0.0);
    switch (form_) {
      case PlateFriction::set_valued:
        next = dynamics::stick_or_slide(drive, level, level, divisor);
        break;
      case PlateFriction::creeping:
        next = dynamics::creep(s.speed_deg_per_s, drive, level, c_.over_creep, divisor);
        break;
      case PlateFriction::none:
        next = drive / T(divisor);
        break;
    }
    const T moved = s.angle_deg + T(c_.step) * next;
    if (form_ == PlateFriction::none) {  // linear, so without stops
      s.speed_deg_per_s = next;
      s.angle_deg = moved;
    } else {
      dynamics::stop_at_ends(s.angle_deg, s.speed_deg_per_s, moved, next, c_.closed, c_.open);
    }
  }
  MGDD_INLINE T output(const State& s) const noexcept { return s.angle_deg; }
  double sample_s() const noexcept { return sample_s_; }

  State at_rest(const T& angle_deg, const T& duty = T(0.0)) const noexcept { return {angle_deg, T(0.0), duty}; }

  /// Duty that balances the springs at an angle, without friction.
  T holding(const T& angle_deg) const noexcept {
    const T x = angle_deg - T(c_.limp_home);
    const auto spring = dynamics::limp_home_spring(x, c_.above, c_.below, c_.over_ramp);
    return spring.elastic + spring.preload;
  }
  bool is_below(const T& angle_deg) const noexcept { return angle_deg < T(c_.limp_home); }
  const FrictionBand<C>& band_at(const T& angle_deg) const noexcept {
    return is_below(angle_deg) ? belief_.below : belief_.above;
  }
  /// Held duty at which the plate would begin to move from an angle, were it at rest there.
  dynamics::Breakaway<T> breakaway(const State& s) const noexcept {
    const FrictionBand<C>& band = band_at(s.angle_deg);
    const T balance = holding(s.angle_deg) + T(band.bias);
    return {balance - T(band.friction), balance + T(band.friction)};
  }

  template <class U>
  PlateModel<U, C> over() const noexcept {
    return std::bit_cast<PlateModel<U, C>>(*this);
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::array{&s.angle_deg, &s.speed_deg_per_s, &s.torque};
  }
  static constexpr std::array<std::string_view, 3> number_names{"angle_deg", "speed_deg_per_s", "torque"};

 private:
  MGDD_INLINE auto load(const T& x, bool up) const noexcept {
    if (frozen_ == 0) return dynamics::limp_home_spring(x, c_.above, c_.below, c_.over_ramp);
    const dynamics::SpringSide<C>& side = up ? c_.above : c_.below;
    return dynamics::spring_of_side(x, T(up ? 1.0 : -1.0), side.stiffness, side.preload, C(0.0));
  }

  struct Coefficients {
    C limp_home, over_ramp;
    dynamics::SpringSide<C> above, below;
    C decay;       // of the lag in one step
    C mean_share;  // of the old torque in the mean over the step
    C step, step_gain, decay_share, over_creep, closed, open;
  };

  double sample_s_;
  PlateFriction form_;
  int frozen_ = 0;
  Coefficients c_{};
  PlateBelief<C> belief_{};
  C gain_{0.0};    // per step
  C damped_{1.0};  // 1 + the share of the speed that a step takes
};

}  // namespace mgdd::control
