// PW-R, the default pseudo-Wiener model of a throttle: a second-order block with dry friction and preload inside, then
// a static map. Units: deg, s, duty. Five parameters per side of limp-home (seven with the map), which map one to one
// to the first-principle groups: tau = J/b, G = (180/pi) g/J, beta = T_pt/g, kappa = (pi/180) k_s/g, delta = T_d/g.
// Every step is noexcept and allocation-free. The scalar T is double, Dual<N> (sensitivities) or Lanes<N> (many runs).
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "mgdd/dynamics/dry_friction.hpp"
#include "mgdd/dynamics/limp_home_spring.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::throttle {

/// Which side of limp-home a prediction uses.
enum class Switching {
  predicted,  ///< by the sign of the predicted position, the preload ramped over +-`ramp_deg`
  measured,   ///< frozen at what the last measurement said, with a dead band
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

/// ParameterError for settings of PW-R outside their domain.
void check_pw_r(const PseudoWienerFrame& frame, double ramp_deg, double tanh_deg_per_s, double dead_band_deg,
                Friction friction);

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
  /// `coulomb`, or `tanh` for gradients: under a load of a share r of the friction that one creeps at up to
  /// w_e atanh(r) (half: 0.55 w_e); the level is right within 0.5 % above 3 w_e.
  Friction friction = Friction::coulomb;

  bool operator==(const BasicPwR&) const = default;

  /// ParameterError naming field, value and bound; on double only.
  void validate() const;
  void validate_settings() const { check_pw_r(frame, ramp_deg, tanh_deg_per_s, dead_band_deg, friction); }

  /// The numbers in the order of `fields`.
  template <class Self>
  static auto numbers(Self& p) noexcept {
    auto& a = p.above;
    auto& b = p.below;
    return std::array{&a.tau_s,
                      &a.gain_deg_per_s2_per_duty,
                      &a.preload_duty,
                      &a.spring_duty_per_deg,
                      &a.coulomb_duty,
                      &a.square_per_deg,
                      &a.cube_per_deg2,
                      &b.tau_s,
                      &b.gain_deg_per_s2_per_duty,
                      &b.preload_duty,
                      &b.spring_duty_per_deg,
                      &b.coulomb_duty,
                      &b.square_per_deg,
                      &b.cube_per_deg2,
                      &p.limp_home_deg};
  }
};
using PwRSide = BasicPwRSide<double>;
using PwR = BasicPwR<double>;

template <class T>
struct BasicPwRState {
  T position_deg{0.0};  ///< x, from limp-home
  T speed_deg_per_s{0.0};
  T bias_duty{0.0};  ///< b, what an observer subtracts from the duty
  T above{1.0};      ///< side of the measured switching: 1 above, -1 below
  DutyLine<T> line{};
};

/// The five groups of a first-principle throttle, both sides.
PwR pw_r_of(const Throttle& throttle) noexcept;

/// What a step needs of one side.
template <class C>
struct PreparedSide {
  dynamics::SpringSide<C> spring;
  C decay;      ///< 1 + h/tau
  C step_gain;  ///< h G
  C friction;   ///< h G delta
};

/// Prepared: coefficients C on states of T, the same or plain numbers on duals.
template <class T, class C = T>
class BasicPwRModel {
 public:
  using Scalar = T;
  using Parameters = BasicPwR<C>;
  using State = BasicPwRState<T>;
  using Input = T;
  static constexpr int n_observed = 3;

  /// ParameterError for settings that no model can work with (`validate_settings`); bounds of numbers are a search's.
  explicit BasicPwRModel(const Parameters& parameters)
      : BasicPwRModel((parameters.validate_settings(), parameters), unchecked) {}
  BasicPwRModel(const Parameters& parameters, Unchecked) noexcept
      : p_(parameters),
        delay_(parameters.frame.delay()),
        h_(parameters.frame.sample_s / parameters.frame.substeps),
        over_ramp_(1.0 / parameters.ramp_deg),
        over_tanh_(1.0 / parameters.tanh_deg_per_s),
        above_(side(parameters.above)),
        below_(side(parameters.below)) {
    lowest_ = inverse_map(p_.below, C(p_.frame.closed_deg) - p_.limp_home_deg);
    highest_ = inverse_map(p_.above, C(p_.frame.open_deg) - p_.limp_home_deg);
  }

  /// One sample: delay line, then the proximal steps of the frame.
  MGDD_INLINE void step(State& s, const T& duty) const noexcept {
    const T acting = s.line.pass(duty, delay_);
    for (int i = 0; i < p_.frame.substeps; ++i)
      advance(s, acting);
  }

  /// Angle [deg].
  MGDD_INLINE T output(const State& s) const noexcept {
    const T x = s.position_deg;
    const auto up = x >= T(0.0);
    return p_.limp_home_deg + x * (T(1.0) + x * (select(up, p_.above.square_per_deg, p_.below.square_per_deg) +
                                                 x * select(up, p_.above.cube_per_deg2, p_.below.cube_per_deg2)));
  }
  double sample_s() const noexcept { return p_.frame.sample_s; }

  /// At rest at an angle, `duty` in the delay line.
  State at_rest(const T& angle_deg, const T& duty = T(0.0)) const noexcept {
    State s;
    s.position_deg = position_of(angle_deg);
    s.above = select(s.position_deg >= T(0.0), T(1.0), T(-1.0));
    s.line.fill(duty);
    return s;
  }

  /// Pulls the state toward a measured angle: x += l1 e, w += l2 e, b -= l3 e; switches the measured side outside the
  /// dead band (position, speed and bias carry over).
  MGDD_INLINE void correct(State& s, const T& angle_deg, const ObserverGains& gains) const noexcept {
    const T x = position_of(angle_deg);
    const T error = x - s.position_deg;
    pull(s.position_deg, s.speed_deg_per_s, s.bias_duty, error, gains);
    confine(s);
    see(s, angle_deg);
  }
  /// Keeps a corrected position inside the travel.
  MGDD_INLINE void confine(State& s) const noexcept {
    s.position_deg = larger(smaller(s.position_deg, T(highest_)), T(lowest_));
  }
  /// Takes the side of the measured switching from a measured angle.
  MGDD_INLINE void see(State& s, const T& angle_deg) const noexcept {
    const T away = angle_deg - p_.limp_home_deg;
    const T band = T(p_.dead_band_deg);
    s.above = select(away > band, T(1.0), select(away < -band, T(-1.0), s.above));
  }

  /// Whether the plate stands still.
  auto stuck(const State& s) const noexcept {
    return larger(s.speed_deg_per_s, -s.speed_deg_per_s) < T(dynamics::rest_speed);
  }
  /// Held duty at which the plate would begin to move from the position of a state, were it at rest there.
  dynamics::Breakaway<T> breakaway(const State& s) const noexcept {
    const auto up = side_of(s);
    const dynamics::SpringLoad<T, C> load = spring(s, up);
    const T balance = s.bias_duty + load.preload + load.elastic;
    const T level =
        T(p_.friction == Friction::tanh ? C(0.0) : select(up, p_.above.coulomb_duty, p_.below.coulomb_duty));
    return {balance - level, balance + level};
  }

  const Parameters& parameters() const noexcept { return p_; }
  template <class U>
  BasicPwRModel<U, C> over() const noexcept {
    return BasicPwRModel<U, C>(*this);
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::apply(
        [&](auto&... before) {
          return std::array{&s.position_deg, &s.speed_deg_per_s, &s.bias_duty, &s.above, &before...};
        },
        s.line.before);
  }
  static constexpr std::array<std::string_view, 4 + max_delay_samples> number_names{
      "position_deg", "speed_deg_per_s", "bias_duty", "above",   "before_0",
      "before_1",     "before_2",        "before_3",  "before_4"};

 private:
  template <class, class>
  friend class BasicPwRModel;
  template <class V>
  explicit BasicPwRModel(const BasicPwRModel<V, C>& o) noexcept
      : p_(o.p_),
        delay_(o.delay_),
        h_(o.h_),
        over_ramp_(o.over_ramp_),
        over_tanh_(o.over_tanh_),
        above_(o.above_),
        below_(o.below_),
        lowest_(o.lowest_),
        highest_(o.highest_) {}

  PreparedSide<C> side(const BasicPwRSide<C>& s) const noexcept {
    const C gain = C(h_) * s.gain_deg_per_s2_per_duty;
    return {{s.spring_duty_per_deg, s.preload_duty}, C(1.0) + C(h_) / s.tau_s, gain, gain * s.coulomb_duty};
  }
  MGDD_INLINE auto side_of(const State& s) const noexcept {
    return p_.switching == Switching::predicted ? s.position_deg >= T(0.0) : s.above >= T(0.0);
  }
  template <class Mask>
  MGDD_INLINE dynamics::SpringLoad<T, C> spring(const State& s, const Mask& up) const noexcept {
    if (p_.switching == Switching::predicted) {
      return dynamics::limp_home_spring(s.position_deg, above_.spring, below_.spring, C(over_ramp_));
    }
    return dynamics::spring_of_side(s.position_deg, s.above,
                                    select(up, above_.spring.stiffness, below_.spring.stiffness),
                                    select(up, above_.spring.preload, below_.spring.preload), C(0.0));
  }
  /// One proximal step with the duty that acts now.
  MGDD_INLINE void advance(State& s, const T& acting_duty) const noexcept {
    const T x = s.position_deg;
    const T w = s.speed_deg_per_s;
    const auto up = side_of(s);
    const bool follows = p_.switching == Switching::predicted;
    const C preload = select(up, above_.spring.preload, below_.spring.preload);
    const C stiffness = select(up, above_.spring.stiffness, below_.spring.stiffness);
    const C gain = select(up, above_.step_gain, below_.step_gain);
    const C friction = select(up, above_.friction, below_.friction);
    const T ratio = x * T(over_ramp_);
    const T clipped = dynamics::linear_share(ratio);
    const T share = follows ? clipped : s.above;
    const C slope = follows ? select(clipped == ratio, preload * C(over_ramp_), C(0.0)) : C(0.0);
    const C divisor = select(up, above_.decay, below_.decay) + C(h_) * gain * (stiffness + slope);
    const T drive = w + gain * (acting_duty - s.bias_duty - preload * share - stiffness * x);
    T next(0.0);
    if (p_.friction == Friction::coulomb) {
      next = dynamics::stick_or_slide(drive, friction, friction, divisor);
    } else {
      next = dynamics::creep(w, drive, friction, C(over_tanh_), divisor);
    }
    const T moved = x + T(h_) * next;
    dynamics::stop_at_ends(s.position_deg, s.speed_deg_per_s, moved, next, lowest_, highest_);
  }
  /// x with h(x) = y: Newton from x = y; monotone because h' >= 0.2 over the travel.
  template <class U>
  MGDD_INLINE static U inverse_map(const BasicPwRSide<C>& s, const U& y) noexcept {
    U x = y;
    for (int i = 0; i < 6; ++i) {
      const U value = x * (U(1.0) + x * (s.square_per_deg + x * s.cube_per_deg2)) - y;
      const U slope = U(1.0) + x * (C(2.0) * s.square_per_deg + C(3.0) * x * s.cube_per_deg2);
      x = x - value / slope;
    }
    return x;
  }
  MGDD_INLINE T position_of(const T& angle_deg) const noexcept {
    const T y = angle_deg - p_.limp_home_deg;
    return select(y >= T(0.0), inverse_map(p_.above, y), inverse_map(p_.below, y));
  }

  Parameters p_;
  dynamics::Delay delay_;
  double h_, over_ramp_, over_tanh_;
  PreparedSide<C> above_, below_;
  C lowest_, highest_;
};
using PwRState = BasicPwRState<double>;
using PwRModel = BasicPwRModel<double>;

}  // namespace mgdd::throttle
