// First-principle throttle in the groups that duty and angle determine: tau = J/b, G = g/J, beta = T_pt/g per side,
// kappa = k_s/g per side, delta = T_d/g, limp-home angle and electrical time L/R; drop and speed of the Stribeck curve,
// presliding (LuGre), delay, a gap between motor and plate that the springs keep closed but at limp-home, the share of
// the damping that is not back-EMF, and stops that yield.
// Set-valued friction is solved exactly in each step. Derivatives by duals, zero while the plate sticks. Units deg, s,
// duty. Steps are noexcept, heap-free. Positions by leapfrog (Hairer et al. 2006, I.1.4), the current exact for a speed
// held over the step, damping implicit.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <tuple>

#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/dry_friction.hpp"
#include "mgdd/dynamics/limp_home_spring.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::throttle {

template <class T>
struct FirstPrincipleState {
  T angle_deg{0.0};  ///< of the motor, seen at the plate shaft; without a gap that of the plate
  T speed_deg_per_s{0.0};
  T torque{0.0};     ///< motor torque over stall torque, as a duty
  T bias_duty{0.0};  ///< what an observer subtracts from the duty
  T bristle_deg{0.0};
  DutyLine<T> line{};
};

/// Prepared: coefficients C on states of T, the same or plain numbers on duals.
template <class T, class C = T>
class FirstPrincipleModel;

/// The family: what is set, not fitted.
struct FirstPrinciple {
  static constexpr int n_parameters = 19;
  static constexpr int n_start = 3;
  static constexpr std::array<FieldInfo, n_parameters> parameters{{
      {"tau_s", "s", log_scale(0.003, 1.0), "time constant J/b"},
      {"gain_deg_per_s2_per_duty", "deg/s² per duty", log_scale(3e3, 1e6), "acceleration per duty G"},
      {"beta_above_duty", "-", log_scale(1e-3, 0.6), "preload above limp-home"},
      {"kappa_above_duty_per_deg", "duty/deg", log_scale(1e-5, 2e-2), "spring above limp-home"},
      {"delta_duty", "-", log_scale(1e-3, 0.5), "dry friction"},
      {"beta_below_duty", "-", log_scale(1e-3, 0.6), "preload below limp-home"},
      {"kappa_below_duty_per_deg", "duty/deg", log_scale(1e-5, 5e-2), "spring below limp-home"},
      {"limp_home_deg", "deg", closed(-5.0, 60.0), "limp-home angle"},
      {"electrical_s", "s", closed(0.0, 0.02), "electrical time constant L/R"},
      {"stribeck_drop", "-", closed(0.0, 1.5), "static over sliding friction, less one"},
      {"stribeck_deg_per_s", "deg/s", log_scale(2.0, 100.0), "speed over which friction drops"},
      {"ramp_deg", "deg", log_scale(0.02, 5.0), "half width of the preload's ramp"},
      {"delay_samples", "-", closed(0.0, max_delay_samples), "delay of the duty, whole samples or not"},
      {"presliding_deg", "deg", closed(0.0, 1.0), "deflection at which dry friction is full, 0 for none"},
      {"presliding_damping", "-", closed(0.0, 2.0), "damping ratio of the bristles"},
      {"half_gap_deg", "deg", closed(0.0, 2.0), "half of the gap between motor and plate"},
      {"viscous_share", "-", closed(0.0, 1.0), "share of the damping that is not back-EMF"},
      {"stop_duty_per_deg", "duty/deg", closed(0.0, 500.0), "stiffness of the stops, 0 for rigid ones"},
      {"stop_damping", "-", closed(0.0, 3.0), "damping ratio of the stops"},
  }};
  static constexpr std::array<FieldInfo, 3> start_numbers{{
      {"angle_deg", "deg", closed(-90.0, 180.0), "angle of the plate"},
      {"speed_deg_per_s", "deg/s", closed(-1e5, 1e5), "speed"},
      {"torque", "-", closed(-2.0, 2.0), "motor torque over stall torque, and the duty until the start"},
  }};
  template <class T>
  using Groups = dynamics::Values<T, n_parameters>;

  double closed_deg = 0.0;
  double open_deg = 90.0;
  int substeps = 2;
  Friction friction = Friction::coulomb;  ///< set-valued with all groups; or tanh, for derivative checks: it creeps
  double tanh_deg_per_s = 30.0;

  bool operator==(const FirstPrinciple&) const = default;

  /// ParameterError naming field, value and bound.
  void validate() const;

  /// A model of numbers in the order of `parameters`; the options must be valid.
  template <class T>
  FirstPrincipleModel<T> prepare(const Groups<T>& values, double sample_s) const noexcept {
    return {*this, values, sample_s};
  }
  template <class T, class Model>
  auto start(const Model& model, const dynamics::Values<T, n_start>& stated) const noexcept {
    typename Model::State state;
    state.angle_deg = model.motor_angle(stated[0]);
    state.speed_deg_per_s = stated[1];
    state.torque = stated[2];
    state.line.fill(stated[2]);
    return state;
  }
};

/// The groups of a throttle, in the order of `FirstPrinciple::parameters`; without delay.
FirstPrinciple::Groups<double> first_principle_of(const Throttle& throttle) noexcept;

template <class T, class C>
class FirstPrincipleModel {
 public:
  using Scalar = T;
  using State = FirstPrincipleState<T>;
  using Input = T;
  static constexpr int n_observed = 4;

  FirstPrincipleModel(const FirstPrinciple& options, const FirstPrinciple::Groups<C>& p, double sample_s) noexcept
      : FirstPrincipleModel(options, sample_s) {
    const C one(1.0), h = C(h_);
    const C& lag = p[8];
    // Shares of the old current at the end of a step and in its mean.
    const auto lags = lag > C(0.0);
    const C held = select(lags, lag, one);
    const C kept = select(lags, exp_of(-h / held), C(0.0));
    const C kept_mean = (lag / h) * (one - kept);
    const C electric = one - p[16];  // only this share follows the current
    const C over = one / (one + (h / p[0]) * (one - electric * kept_mean));
    const C slip = over * (h * p[1]);
    const C presliding = select(p[4] > C(0.0), p[13], C(0.0));  // nothing to bend for
    const C stiffness = p[4] / larger(presliding, C(least_presliding_deg));
    c_ = {.limp_home = p[7],
          .kept = kept,
          .kept_mean = kept_mean,
          .over = over,
          .slip = slip,
          .hold = slip * (p[4] * (one + p[9])),
          .slide = slip * p[4],
          .drop = p[9],
          .over_stribeck = one / p[10],
          .breakaway = p[4] * (one + p[9]),
          .over_ramp = one / p[11],
          .over_tanh = C(1.0 / options.tanh_deg_per_s),
          .above = {p[3], p[2]},
          .below = {p[6], p[5]},
          .half_gap = p[15],
          .closed = C(options.closed_deg) - p[15],
          .open = C(options.open_deg) + p[15],
          .braking = electric / (p[0] * p[1]),
          .delay = p[12],
          .presliding = presliding,
          .bristle = slip * stiffness,
          .bristle_damping = slip * (C(2.0) * p[14] * pow_of(stiffness / p[1], C(0.5))),
          .stop = slip * p[17],
          .stop_damping = slip * (C(2.0) * p[18] * pow_of(larger(p[17], C(least_stop)) / p[1], C(0.5))),
          .stop_implicit = C(0.5) * h * slip * p[17]};
    yields_ = acts(p[17]);
    drops_ = acts(p[9]);
    preslides_ = acts(presliding);
    gapes_ = acts(p[15]);
    if constexpr (std::floating_point<C>) delay_ = dynamics::Delay(static_cast<double>(p[12]));
  }

  MGDD_INLINE void step(State& s, const T& duty) const noexcept {
    const T acting = delayed(s.line, duty) - s.bias_duty;
    const C half = C(0.5 * h_);
    for (int k = 0; k < options_.substeps; ++k) {
      const T middle = s.angle_deg + half * s.speed_deg_per_s;
      const dynamics::SpringLoad<T, C> spring = spring_at(middle);
      const T driven = c_.kept_mean * s.torque + (C(1.0) - c_.kept_mean) * acting;
      const T push = c_.over * s.speed_deg_per_s + c_.slip * (driven - spring.preload - spring.elastic);
      const T next = yields_ ? stopped(s, middle, push) : rubbed(s, push, C(1.0));
      s.torque = c_.kept * s.torque + (C(1.0) - c_.kept) * (acting - c_.braking * next);
      const T moved = middle + half * next;
      dynamics::stop_at_ends(s.angle_deg, s.speed_deg_per_s, moved, next, c_.closed, c_.open);
      if (yields_) {
        const auto soft = c_.stop > C(0.0);
        s.angle_deg = select(soft, moved, s.angle_deg);
        s.speed_deg_per_s = select(soft, next, s.speed_deg_per_s);
      }
    }
  }
  MGDD_INLINE T output(const State& s) const noexcept {
    return gapes_ ? c_.limp_home + carried(T(s.angle_deg - c_.limp_home)) : s.angle_deg;
  }
  double sample_s() const noexcept { return sample_s_; }

  /// At rest at an angle of the plate under a duty.
  State at_rest(const T& angle_deg, const T& duty = T(0.0)) const noexcept {
    State s;
    s.angle_deg = motor_angle(angle_deg);
    s.torque = duty;
    s.line.fill(duty);
    return s;
  }
  /// Where the motor stands when the spring presses a plate at this angle against it.
  T motor_angle(const T& plate_deg) const noexcept {
    return plate_deg + dynamics::along(c_.half_gap, T(plate_deg - c_.limp_home));
  }

  /// Pulls the state toward a measured angle.
  MGDD_INLINE void correct(State& s, const T& angle_deg, const ObserverGains& gains) const noexcept {
    const T error = angle_deg - output(s);
    pull(s.angle_deg, s.speed_deg_per_s, s.bias_duty, error, gains);
    confine(s);
  }
  /// Keeps a corrected angle inside the travel.
  MGDD_INLINE void confine(State& s) const noexcept {
    s.angle_deg = larger(smaller(s.angle_deg, T(c_.open)), T(c_.closed));
  }

  /// Whether the plate stands still.
  auto stuck(const State& s) const noexcept {
    return larger(s.speed_deg_per_s, -s.speed_deg_per_s) < T(dynamics::rest_speed);
  }
  /// Held duty at which the plate would begin to move from the angle of a state, were it at rest there.
  dynamics::Breakaway<T> breakaway(const State& s) const noexcept {
    const dynamics::SpringLoad<T, C> spring = spring_at(s.angle_deg);
    const T balance = s.bias_duty + spring.preload + spring.elastic;
    const C level = options_.friction == Friction::tanh ? C(0.0) : c_.breakaway;
    return {balance - level, balance + level};
  }

  template <class U>
  FirstPrincipleModel<U, C> over() const noexcept {
    FirstPrincipleModel<U, C> other(options_, sample_s_);
    other.drops_ = drops_;
    other.preslides_ = preslides_;
    other.gapes_ = gapes_;
    other.yields_ = yields_;
    other.delay_ = delay_;
    other.c_ = std::bit_cast<typename FirstPrincipleModel<U, C>::Coefficients>(c_);
    return other;
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::apply(
        [&](auto&... before) {
          return std::array{&s.angle_deg, &s.speed_deg_per_s, &s.torque, &s.bias_duty, &s.bristle_deg, &before...};
        },
        s.line.before);
  }
  static constexpr std::array<std::string_view, 5 + max_delay_samples> number_names{
      "angle_deg", "speed_deg_per_s", "torque",   "bias_duty", "bristle_deg",
      "before_0",  "before_1",        "before_2", "before_3",  "before_4"};

 private:
  static constexpr double least_presliding_deg = 1e-3;  // where a lane without bristles computes them all the same
  static constexpr double least_stop = 1e-6;

  FirstPrincipleModel(const FirstPrinciple& options, double sample_s) noexcept
      : options_(options), sample_s_(sample_s), h_(sample_s / options.substeps) {}

  // Whether a number, one of its lanes or a derivative is not zero.
  static bool acts(std::floating_point auto c) noexcept { return c != 0; }
  template <int N, class S>
  static bool acts(const Dual<N, S>& c) noexcept {
    return c.value != S(0) || std::ranges::any_of(c.grad, [](S g) { return g != S(0); });
  }
  template <int N>
  static bool acts(const Lanes<N>& c) noexcept {
    bool any = false;
    for (int i = 0; i < N; ++i)
      any = any || c[i] != 0.0;
    return any;
  }

  // How far from limp-home the plate is when the motor is `x` from it.
  MGDD_INLINE T carried(const T& x) const noexcept {
    const T gap(c_.half_gap);
    return x - larger(smaller(x, gap), -gap);
  }
  // The speed after a step, at a stop that yields: it pushes and does not pull, linearly implicit.
  MGDD_INLINE T stopped(State& s, const T& middle, const T& push) const noexcept {
    const T beyond = middle - larger(smaller(middle, T(c_.open)), T(c_.closed));
    const T back = c_.stop * beyond;
    const auto touches = (back + c_.stop_damping * s.speed_deg_per_s) * beyond > T(0.0);
    const T divisor = select(touches, T(C(1.0) + c_.stop_damping + c_.stop_implicit), T(1.0));
    return rubbed(s, T(push - select(touches, back, T(0.0))), divisor);
  }
  MGDD_INLINE dynamics::SpringLoad<T, C> spring_at(const T& motor_deg) const noexcept {
    const T x = motor_deg - c_.limp_home;
    return dynamics::limp_home_spring(gapes_ ? carried(x) : x, c_.above, c_.below, c_.over_ramp);
  }

  MGDD_INLINE T delayed(DutyLine<T>& line, const T& duty) const noexcept {
    if constexpr (std::floating_point<C>) {
      return line.pass(duty, delay_);
    } else {
      const T acting = line.at(duty, c_.delay);
      line.push(duty);
      return acting;
    }
  }

  // The speed after a step whose speed without dry friction is `push`.
  template <class D>
  MGDD_INLINE T rubbed(State& s, const T& push, const D& divisor) const noexcept {
    const T& speed = s.speed_deg_per_s;
    if (options_.friction == Friction::tanh) return dynamics::creep(speed, push, c_.slide, c_.over_tanh, divisor);
    if (drops_ || preslides_) return bent(s, push, divisor);
    return dynamics::stick_or_slide(push, c_.hold, c_.slide, divisor);
  }
  // The same with a Stribeck curve or bristles.
  template <class D>
  MGDD_INLINE T bent(State& s, const T& push, const D& divisor) const noexcept {
    const T& speed = s.speed_deg_per_s;
    const T ratio = speed * c_.over_stribeck;
    const T level = c_.slide * (T(1.0) + c_.drop * exp_of(-ratio * ratio));
    const T rigid = dynamics::stick_or_slide(push, c_.hold, level, divisor);
    if (!preslides_) return rigid;
    const dynamics::Bristles<C> bristles{c_.bristle, c_.bristle_damping};
    const T soft = dynamics::bend_or_slide(speed, push, level, bristles, h_, divisor, s.bristle_deg);
    return select(c_.presliding > C(0.0), soft, rigid);
  }

  struct Coefficients {
    C limp_home;
    C kept, kept_mean;  // of the current, at the end of a step and in its mean
    C over;             // of the speed, after the damping of a step
    C slip;             // speed per duty in a step
    C hold, slide;      // dry friction as a speed
    C drop, over_stribeck;
    C breakaway;
    C over_ramp, over_tanh;
    dynamics::SpringSide<C> above, below;
    C half_gap;
    C closed, open;
    C braking;  // torque per speed
    C delay;
    C presliding;
    C bristle, bristle_damping;
    C stop, stop_damping, stop_implicit;
  };

  FirstPrinciple options_;
  double sample_s_;
  double h_;
  bool drops_ = false;
  bool preslides_ = false;
  bool gapes_ = false;
  bool yields_ = false;
  dynamics::Delay delay_;  // used where C is a plain number
  Coefficients c_{};

  template <class, class>
  friend class FirstPrincipleModel;
};

}  // namespace mgdd::throttle
