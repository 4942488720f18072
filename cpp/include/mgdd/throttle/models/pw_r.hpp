// PW-R, the default pseudo-Wiener model of a throttle: a second-order block with dry friction and preload inside, then
// a static map. Units: deg, s, duty. Five parameters per side of limp-home (seven with the map), which map one to one
// to the first-principle groups: tau = J/b, G = (180/pi) g/J, beta = T_pt/g, kappa = (pi/180) k_s/g, delta = T_d/g.
// Every step is noexcept and allocation-free. The scalar T is double, Dual<N> (sensitivities) or Lanes<N> (many runs).
#pragma once

#include <cstddef>
#include <type_traits>

#include "mgdd/math/select.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::throttle {

/// Which side of limp-home a prediction uses.
enum class Switching {
  predicted,  ///< by the sign of the predicted position, the preload ramped over +-`ramp_deg`
  measured,   ///< frozen at what the last measurement said, with a dead band
};
enum class DryFriction {
  set_valued,  ///< sticks exactly (proximal step)
  /// Smooth, for gradients: under a load of a share r of the friction it creeps at up to w_e atanh(r) (half: 0.55 w_e);
  /// the level is right within 0.5 % above 3 w_e.
  tanh,
};

template <class T>
struct BasicPwRSide {
  T tau_s{0.0197};
  T gain_deg_per_s2_per_duty{83597.0};  ///< G
  T preload_duty{0.1292};               ///< beta
  T spring_duty_per_deg{4.96e-4};       ///< kappa
  T coulomb_duty{0.0927};               ///< delta
  T square_per_deg{0.0};                ///< c2 of h(x) = x + c2 x^2 + c3 x^3
  T cube_per_deg2{0.0};                 ///< c3

  bool operator==(const BasicPwRSide&) const = default;
};

template <class T>
struct BasicPwR {
  BasicPwRSide<T> above{};
  BasicPwRSide<T> below{};
  T limp_home_deg{8.0};
  PseudoWienerFrame frame{};
  double ramp_deg = 0.25;  ///< half width over which the preload changes its sign; 0.5 in control
  double tanh_deg_per_s = 30.0;
  double dead_band_deg = 0.3;  ///< of the measured switching
  Switching switching = Switching::predicted;
  DryFriction friction = DryFriction::set_valued;

  bool operator==(const BasicPwR&) const = default;

  /// ParameterError naming field, value and bound.
  void validate() const
    requires std::is_same_v<T, double>;
};
using PwRSide = BasicPwRSide<double>;
using PwR = BasicPwR<double>;

template <class T>
struct BasicPwRState {
  T position_deg{0.0};  ///< x, from limp-home
  T speed_deg_per_s{0.0};
  T bias_duty{0.0};  ///< b, what an observer subtracts from the duty
  T above{1.0};      ///< side of the measured switching: 1 above, -1 below
  DelayLine<T> line{};
};

/// The five groups of a first-principle throttle, both sides.
PwR pw_r_of(const Throttle& throttle) noexcept;

/// A model with everything prepared that a step of `step_s` needs.
template <class T>
class BasicPwRModel {
 public:
  using Parameters = BasicPwR<T>;
  using State = BasicPwRState<T>;

  explicit BasicPwRModel(const Parameters& parameters) noexcept
      : BasicPwRModel(parameters, parameters.frame.sample_s / parameters.frame.substeps) {}
  BasicPwRModel(const Parameters& parameters, double step_s) noexcept
      : p_(parameters), h_(step_s), above_(side(parameters.above)), below_(side(parameters.below)) {
    lowest_ = inverse_map(p_.below, T(p_.frame.closed_deg) - p_.limp_home_deg);
    highest_ = inverse_map(p_.above, T(p_.frame.open_deg) - p_.limp_home_deg);
  }

  /// One proximal step with the duty that acts now.
  MGDD_INLINE void step(State& s, const T& acting_duty) const noexcept {
    const T zero(0.0);
    const T one(1.0);
    const T x = s.position_deg;
    const T w = s.speed_deg_per_s;
    const bool follows = p_.switching == Switching::predicted;
    const auto up = follows ? x >= zero : s.above >= zero;
    const T preload = select(up, above_.preload, below_.preload);
    const T spring = select(up, above_.spring, below_.spring);
    const T gain = select(up, above_.step_gain, below_.step_gain);
    const T friction = select(up, above_.friction, below_.friction);
    const T ramp = x * T(1.0 / p_.ramp_deg);
    const T clipped = larger(smaller(ramp, one), -one);
    const T share = follows ? clipped : s.above;
    const T slope = follows ? select(clipped == ramp, preload * T(1.0 / p_.ramp_deg), zero) : zero;
    const T divisor = select(up, above_.decay, below_.decay) + T(h_) * gain * (spring + slope);
    const T drive = w + gain * (acting_duty - s.bias_duty - preload * share - spring * x);
    T next = zero;
    if (p_.friction == DryFriction::set_valued) {
      const T size = larger(drive, -drive);
      next = select(size <= friction, zero, (drive - with_sign(friction, drive)) / divisor);
    } else {
      const T t = tanh_of(w * T(1.0 / p_.tanh_deg_per_s));
      const T steep = friction * (one - t * t) * T(1.0 / p_.tanh_deg_per_s);
      next = (drive - friction * t + steep * w) / (divisor + steep);
    }
    const T moved = x + T(h_) * next;
    const T held = larger(smaller(moved, highest_), lowest_);
    s.speed_deg_per_s = select(held == moved, next, zero);
    s.position_deg = held;
  }

  /// One sample: delay line, then the steps of the frame.
  MGDD_INLINE void advance(State& s, const T& duty) const noexcept {
    const T acting = s.line.pass(duty, p_.frame.delay_samples);
    for (int i = 0; i < p_.frame.substeps; ++i)
      step(s, acting);
  }

  /// Angle [deg].
  MGDD_INLINE T output(const State& s) const noexcept {
    const T x = s.position_deg;
    const auto up = x >= T(0.0);
    return p_.limp_home_deg + x * (T(1.0) + x * (select(up, p_.above.square_per_deg, p_.below.square_per_deg) +
                                                 x * select(up, p_.above.cube_per_deg2, p_.below.cube_per_deg2)));
  }

  /// At rest at an angle, `duty` in the delay line.
  State at_rest(const T& angle_deg, const T& duty) const noexcept {
    State s;
    s.position_deg = position_of(angle_deg);
    s.above = select(s.position_deg >= T(0.0), T(1.0), T(-1.0));
    s.line.fill(duty);
    return s;
  }

  /// Pulls the state toward a measured angle: x += l1 e, w += l2 e, b -= l3 e; switches the measured side outside the
  /// dead band (position, speed and bias carry over).
  MGDD_INLINE void reanchor(State& s, const T& angle_deg, const Anchor& a) const noexcept {
    const T x = position_of(angle_deg);
    const T error = x - s.position_deg;
    const T limit(a.bias_limit_duty);
    s.position_deg = larger(smaller(s.position_deg + T(a.angle_gain) * error, highest_), lowest_);
    s.speed_deg_per_s += T(a.speed_gain_per_s) * error;
    s.bias_duty = larger(smaller(s.bias_duty - T(a.bias_gain_duty_per_deg) * error, limit), -limit);
    const T away = angle_deg - p_.limp_home_deg;
    const T band(p_.dead_band_deg);
    s.above = select(away > band, T(1.0), select(away < -band, T(-1.0), s.above));
  }

  const Parameters& parameters() const noexcept { return p_; }

 private:
  struct Side {
    T decay;      // 1 + h/tau
    T step_gain;  // h G
    T preload, spring;
    T friction;  // h G delta
  };
  Side side(const BasicPwRSide<T>& s) const noexcept {
    const T gain = T(h_) * s.gain_deg_per_s2_per_duty;
    return {T(1.0) + T(h_) / s.tau_s, gain, s.preload_duty, s.spring_duty_per_deg, gain * s.coulomb_duty};
  }
  /// x with h(x) = y: Newton from x = y; monotone because h' >= 0.2 over the travel.
  MGDD_INLINE static T inverse_map(const BasicPwRSide<T>& s, const T& y) noexcept {
    T x = y;
    for (int i = 0; i < 6; ++i) {
      const T value = x * (T(1.0) + x * (s.square_per_deg + x * s.cube_per_deg2)) - y;
      const T slope = T(1.0) + x * (T(2.0) * s.square_per_deg + T(3.0) * x * s.cube_per_deg2);
      x = x - value / slope;
    }
    return x;
  }
  MGDD_INLINE T position_of(const T& angle_deg) const noexcept {
    const T y = angle_deg - p_.limp_home_deg;
    return select(y >= T(0.0), inverse_map(p_.above, y), inverse_map(p_.below, y));
  }

  Parameters p_;
  double h_;
  Side above_, below_;
  T lowest_, highest_;
};
using PwRState = BasicPwRState<double>;
using PwRModel = BasicPwRModel<double>;

/// One proximal step of length `dt_s` from bare parameters; a loop prepares a model once instead.
template <class T>
void step(const BasicPwR<T>& parameters, BasicPwRState<T>& state, const T& duty, double dt_s) noexcept {
  BasicPwRModel<T>(parameters, dt_s).step(state, duty);
}

}  // namespace mgdd::throttle
