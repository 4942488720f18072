// First-principle throttle in the groups that duty and angle determine: tau = J/b, G = g/J, beta = T_pt/g per side,
// kappa = k_s/g per side, delta = T_d/g, limp-home angle and electrical time L/R. Set-valued friction is solved exactly
// in each step; derivatives by duals, zero while the plate sticks. Units deg, s, duty. Steps are noexcept, heap-free.
// Method as in throttle/plant.hpp; the electrical lag takes its own step before the mechanics.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <string_view>
#include <tuple>

#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/dry_friction.hpp"
#include "mgdd/throttle/limp_home_spring.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::throttle {

template <class T>
struct FirstPrincipleState {
  T angle_deg{0.0};
  T speed_deg_per_s{0.0};
  T torque{0.0};     ///< motor torque over stall torque, as a duty
  T bias_duty{0.0};  ///< what an observer subtracts from the duty
  DutyLine<T> line{};
};

/// Prepared: coefficients C on states of T, the same or plain numbers on duals.
template <class T, class C = T>
class FirstPrincipleModel;

/// The family: what is set, not fitted.
struct FirstPrinciple {
  static constexpr int n_parameters = 9;
  static constexpr int n_start = 3;
  static constexpr std::array<FieldInfo, 9> parameters{{
      {"tau_s", "s", log_scale(0.003, 1.0), "time constant J/b"},
      {"gain_deg_per_s2_per_duty", "deg/s² per duty", log_scale(3e3, 1e6), "acceleration per duty G"},
      {"beta_above_duty", "-", log_scale(1e-3, 0.6), "preload above limp-home"},
      {"kappa_above_duty_per_deg", "duty/deg", log_scale(1e-5, 2e-2), "spring above limp-home"},
      {"delta_duty", "-", log_scale(1e-3, 0.5), "dry friction"},
      {"beta_below_duty", "-", log_scale(1e-3, 0.6), "preload below limp-home"},
      {"kappa_below_duty_per_deg", "duty/deg", log_scale(1e-5, 5e-2), "spring below limp-home"},
      {"limp_home_deg", "deg", closed(-5.0, 60.0), "limp-home angle"},
      {"electrical_s", "s", closed(0.0, 0.02), "electrical time constant L/R"},
  }};
  static constexpr std::array<FieldInfo, 3> start_numbers{{
      {"angle_deg", "deg", closed(-90.0, 180.0), "angle"},
      {"speed_deg_per_s", "deg/s", closed(-1e5, 1e5), "speed"},
      {"torque", "-", closed(-2.0, 2.0), "motor torque over stall torque"},
  }};

  double closed_deg = 0.0;
  double open_deg = 90.0;
  double ramp_deg = 0.25;  ///< half width of the preload's ramp
  int substeps = 2;
  double delay_samples = 0.0;             ///< of the duty, 0..5, whole or not
  Friction friction = Friction::coulomb;  ///< or tanh, for derivative checks: it creeps
  double tanh_deg_per_s = 30.0;

  bool operator==(const FirstPrinciple&) const = default;

  /// ParameterError naming field, value and bound.
  void validate() const;

  /// A model of numbers in the order of `parameters`; the options must be valid.
  template <class T>
  FirstPrincipleModel<T> prepare(const dynamics::Values<T, 9>& values, double sample_s) const noexcept {
    return {*this, values, sample_s};
  }
  template <class T, class Model>
  auto start(const Model&, const dynamics::Values<T, 3>& stated) const noexcept {
    typename Model::State state;
    state.angle_deg = stated[0];
    state.speed_deg_per_s = stated[1];
    state.torque = stated[2];
    return state;
  }
};

/// The groups of a throttle, in the order of `FirstPrinciple::parameters`.
dynamics::Values<double, 9> first_principle_of(const Throttle& throttle) noexcept;

template <class T, class C>
class FirstPrincipleModel {
 public:
  using Scalar = T;
  using State = FirstPrincipleState<T>;
  using Input = T;
  static constexpr int n_observed = 4;

  FirstPrincipleModel(const FirstPrinciple& options, const dynamics::Values<C, 9>& p, double sample_s) noexcept
      : FirstPrincipleModel(options, sample_s) {
    const C h = C(h_);
    const C over_tau = C(1.0) / p[0];
    const C lag = p[8] / h;
    const C share = C(1.0) / (C(1.0) + lag);
    const C damped = C(1.0) + (h * over_tau) * share;
    c_ = {.limp_home = p[7],
          .lag = lag,
          .share = share,
          .gain = p[1],
          .limit = h * (p[1] * p[4]),
          .delta = p[4],
          .over_ramp = C(1.0 / options.ramp_deg),
          .over_tanh = C(1.0 / options.tanh_deg_per_s),
          .above = {p[3], p[2]},
          .below = {p[6], p[5]},
          .closed = C(options.closed_deg),
          .open = C(options.open_deg),
          .divisor_above = damped + (h * h) * (p[1] * p[3]),
          .divisor_below = damped + (h * h) * (p[1] * p[6]),
          .braking = share * (over_tau / p[1])};
  }

  MGDD_INLINE void step(State& s, const T& duty) const noexcept {
    const T acting = s.line.pass(duty, delay_) - s.bias_duty;
    const C h = C(h_);
    for (int k = 0; k < options_.substeps; ++k) {
      const T x = s.angle_deg - c_.limp_home;
      const SpringLoad<T, C> spring = limp_home_spring(x, c_.above, c_.below, c_.over_ramp);
      const T free_torque = c_.share * (c_.lag * s.torque + acting);
      const T push = s.speed_deg_per_s + h * (c_.gain * (free_torque - spring.preload - spring.elastic));
      const C divisor = select(x >= T(0.0), c_.divisor_above, c_.divisor_below);
      const T next = options_.friction == Friction::tanh
                         ? dynamics::creep(s.speed_deg_per_s, push, c_.limit, c_.over_tanh, divisor)
                         : dynamics::stick_or_slide(push, c_.limit, c_.limit, divisor);
      s.torque = free_torque - c_.braking * next;
      const T moved = s.angle_deg + h * next;
      dynamics::stop_at_ends(s.angle_deg, s.speed_deg_per_s, moved, next, c_.closed, c_.open);
    }
  }
  MGDD_INLINE T output(const State& s) const noexcept { return s.angle_deg; }
  double sample_s() const noexcept { return sample_s_; }

  /// At rest at an angle under a duty.
  State at_rest(const T& angle_deg, const T& duty = T(0.0)) const noexcept {
    State s;
    s.angle_deg = angle_deg;
    s.torque = duty;
    s.line.fill(duty);
    return s;
  }

  /// Pulls the state toward a measured angle.
  MGDD_INLINE void correct(State& s, const T& angle_deg, const ObserverGains& gains) const noexcept {
    const T error = angle_deg - s.angle_deg;
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
    const SpringLoad<T, C> spring = limp_home_spring(T(s.angle_deg - c_.limp_home), c_.above, c_.below, c_.over_ramp);
    const T balance = s.bias_duty + spring.preload + spring.elastic;
    const C level = options_.friction == Friction::tanh ? C(0.0) : c_.delta;
    return {balance - level, balance + level};
  }

  template <class U>
  FirstPrincipleModel<U, C> over() const noexcept {
    FirstPrincipleModel<U, C> other(options_, sample_s_);
    other.c_ = std::bit_cast<typename FirstPrincipleModel<U, C>::Coefficients>(c_);
    return other;
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::apply(
        [&](auto&... before) {
          return std::array{&s.angle_deg, &s.speed_deg_per_s, &s.torque, &s.bias_duty, &before...};
        },
        s.line.before);
  }
  static constexpr std::array<std::string_view, 4 + max_delay_samples> number_names{
      "angle_deg", "speed_deg_per_s", "torque",   "bias_duty", "before_0",
      "before_1",  "before_2",        "before_3", "before_4"};

 private:
  FirstPrincipleModel(const FirstPrinciple& options, double sample_s) noexcept
      : options_(options), sample_s_(sample_s), h_(sample_s / options.substeps), delay_(options.delay_samples) {}

  struct Coefficients {
    C limp_home;
    C lag;    // electrical time over the step
    C share;  // of the new current that follows the voltage
    C gain;
    C limit;  // h G delta
    C delta;
    C over_ramp, over_tanh;
    SpringSide<C> above, below;
    C closed, open;
    C divisor_above, divisor_below;
    C braking;  // torque per speed
  };

  FirstPrinciple options_;
  double sample_s_;
  double h_;
  dynamics::Delay delay_;
  Coefficients c_{};

  template <class, class>
  friend class FirstPrincipleModel;
};

}  // namespace mgdd::throttle
