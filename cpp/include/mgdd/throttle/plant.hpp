// Electronic throttle body as a plant: fixed-step simulation that sticks exactly, never chatters and never creeps.
// `step` is noexcept and allocation-free for every option. SI and radians inside. The scalar T is double, float,
// Dual<N> for sensitivities, or Lanes<N> for N throttles or N runs at once, with the same bits in every lane. Method:
// semi-implicit step, linearly implicit in motor, viscous friction, springs and stops; the set-valued friction is
// solved exactly (Moreau 1988; Brogliato and Tanwani 2020, section 5). First order in the step, 0.1 ms by default.
#pragma once

#include <array>
#include <cstddef>

#include "mgdd/common/units.hpp"
#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/dry_friction.hpp"
#include "mgdd/dynamics/limp_home_spring.hpp"
#include "mgdd/dynamics/play.hpp"
#include "mgdd/math/select.hpp"
#include "mgdd/throttle/plant_coefficients.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::throttle {

inline constexpr double default_step_s = 1e-4;
inline constexpr double step_lower_s = 1e-6;
inline constexpr double step_upper_s = 5e-3;

template <class T>
struct BasicThrottleState {
  T angle_rad{0.0};  ///< of the motor and gear, at plate scale
  T speed_rad_per_s{0.0};
  T current_a{0.0};
  T bristle_rad{0.0};            ///< LuGre only
  T plate_angle_rad{0.0};        ///< of the plate: what sensors see; differs from the gear's only with backlash
  T plate_speed_rad_per_s{0.0};  ///< backlash by compliance only, otherwise the gear's
  T plate_bristle_rad{0.0};
};

template <class T>
struct BasicThrottleInput {
  T duty{0.0};               ///< [-] clipped to -1..1
  T supply_v{12.0};          ///< of the bridge, now
  T airflow_torque_nm{0.0};  ///< positive when it opens; in addition to the modelled air flow
  Bridge bridge = Bridge::brake;
};

/// Torques of the last step as the scheme books them, so that energy adds up.
template <class T>
struct BasicThrottleTorques {
  T motor_nm{0.0};
  T viscous_nm{0.0};
  T friction_nm{0.0};
  T spring_nm{0.0};  ///< positive when it closes
  T stop_nm{0.0};    ///< positive when it opens
  T air_nm{0.0};
};

/// Coefficients C on states of T: the same, or plain numbers on duals.
template <class T, class C = T>
class BasicThrottlePlant {
 public:
  using Scalar = T;
  using State = BasicThrottleState<T>;
  using Input = BasicThrottleInput<T>;
  using Torques = BasicThrottleTorques<T>;
  static constexpr int n_observed = 5;

  /// ParameterError for a bad parameter or a step outside [1e-6, 5e-3] s; on double only.
  explicit BasicThrottlePlant(const Throttle& throttle, double step_s = default_step_s);

  /// From prepared coefficients; `options` gives the forms of friction and backlash, the same in every lane.
  BasicThrottlePlant(const PlantCoefficients<C>& coefficients, const Throttle& options, double step_s) noexcept
      : c_(coefficients),
        step_s_(step_s),
        friction_(options.friction),
        backlash_(options.backlash),
        flows_(options.pressure_drop_kpa > 0.0) {}

  /// Advances by one step.
  MGDD_INLINE void step(State& state, const Input& input) const noexcept {
    Torques ignored;
    step(state, input, ignored);
  }
  MGDD_INLINE void step(State& state, const Input& input, Torques& torques) const noexcept;

  /// Angle of the plate [deg].
  MGDD_INLINE T output(const State& state) const noexcept {
    return state.plate_angle_rad * T(1.0 / units::rad_per_deg);
  }
  double step_s() const noexcept { return step_s_; }
  double sample_s() const noexcept { return step_s_; }
  const PlantCoefficients<C>& coefficients() const noexcept { return c_; }

  template <class S>
  static auto numbers(S& s) noexcept {
    return std::array{&s.angle_rad, &s.speed_rad_per_s, &s.plate_angle_rad,  &s.plate_speed_rad_per_s,
                      &s.current_a, &s.bristle_rad,     &s.plate_bristle_rad};
  }
  static constexpr std::array<std::string_view, 7> number_names{
      "angle_rad", "speed_rad_per_s", "plate_angle_rad",  "plate_speed_rad_per_s",
      "current_a", "bristle_rad",     "plate_bristle_rad"};

  /// At rest at an angle [deg], without current; the plate in the middle of the gap.
  State at_rest(const T& angle_deg) const noexcept {
    State s;
    s.angle_rad = s.plate_angle_rad = angle_deg * T(units::rad_per_deg);
    return s;
  }
  /// A duty under the nominal supply.
  Input input(const T& duty) const noexcept { return {.duty = duty, .supply_v = T(c_.supply)}; }

  /// Whether motor and plate stand still (with tanh and LuGre friction they creep).
  auto stuck(const State& s) const noexcept {
    const T rest = T(dynamics::rest_speed);
    const auto motor_rests = larger(s.speed_rad_per_s, -s.speed_rad_per_s) < rest;
    const auto plate_rests = larger(s.plate_speed_rad_per_s, -s.plate_speed_rad_per_s) < rest;
    return motor_rests & plate_rests;
  }
  /// Held duty at which the throttle would begin to move from the angle of a state, were it at rest there: the gear
  /// against the plate, the current settled. With LuGre friction the end of presliding.
  dynamics::Breakaway<T> breakaway(const State& s, const Input& in) const noexcept {
    const T balance = -load(s.plate_angle_rad, in).torque;
    const T level = T(dynamics::breakaway_level(friction_, c_.whole.levels));
    return {duty_of(balance - level, in), duty_of(balance + level, in)};
  }
  dynamics::Breakaway<T> breakaway(const State& s) const noexcept { return breakaway(s, input(T(0.0))); }

  /// The same plant with states of another scalar.
  template <class U>
  BasicThrottlePlant<U, C> over() const noexcept {
    Throttle options;
    options.friction = friction_;
    options.backlash = backlash_;
    options.pressure_drop_kpa = flows_ ? 1.0 : 0.0;
    return {c_, options, step_s_};
  }

 private:
  struct Motor {
    T free_current;  ///< current at the next instant if the plate stood still
    C current_per_speed;
  };
  struct Load {
    T torque;    ///< spring, stops and air at the present angle
    C implicit;  ///< what multiplies the next speed
    T spring;
    C spring_implicit;
    T stop;
    C stop_implicit;
    T air;
  };
  MGDD_INLINE Motor motor(const State& s, const Input& in) const noexcept;
  MGDD_INLINE Load load(const T& angle, const Input& in) const noexcept;
  MGDD_INLINE T friction(const FrictionCoefficients<C>& f, const C& inertia_over_h, const T& speed, const T& momentum,
                         const C& divisor, T& bristle) const noexcept {
    return dynamics::next_speed(friction_, f.levels, c_.shape, f.bristles, step_s_, inertia_over_h, speed, momentum,
                                divisor, bristle);
  }
  T duty_of(const T& torque, const Input& in) const noexcept {
    const T volts_per_duty = larger(in.supply_v - c_.drop, T(1e-9));
    return torque * c_.resistance / (c_.torque_constant * volts_per_duty) + dynamics::along(c_.dead_band, torque);
  }
  MGDD_INLINE void step_one_mass(State& s, const Input& in, Torques& torques) const noexcept;
  MGDD_INLINE void step_two_masses(State& s, const Input& in, Torques& torques) const noexcept;

  PlantCoefficients<C> c_;
  double step_s_;
  Friction friction_;
  Backlash backlash_;
  bool flows_;
};

using ThrottleState = BasicThrottleState<double>;
using ThrottleInput = BasicThrottleInput<double>;
using ThrottleTorques = BasicThrottleTorques<double>;
using ThrottlePlant = BasicThrottlePlant<double>;

/// At rest at an angle [deg], without current; the plate in the middle of the gap.
ThrottleState at_rest(double angle_deg) noexcept;

/// C_T of the air's torque at an angle of the plate [rad].
template <class T>
MGDD_INLINE T airflow_share(const T& angle_rad) noexcept {
  if constexpr (is_dual_v<T>) {
    using S = typename T::Scalar;
    const AirflowPoint at = airflow_point(static_cast<double>(angle_rad.value) / units::rad_per_deg);
    return chain(static_cast<S>(at.coefficient), static_cast<S>(at.slope_per_deg / units::rad_per_deg), angle_rad);
  } else {
    return each(angle_rad, [](auto rad) {
      return static_cast<decltype(rad)>(airflow_coefficient(static_cast<double>(rad) / units::rad_per_deg));
    });
  }
}

// --- the step -------------------------------------------------------------------------------------------------

template <class T, class C>
auto BasicThrottlePlant<T, C>::motor(const State& s, const Input& in) const noexcept -> Motor {
  const T duty = larger(smaller(in.duty, T(1.0)), T(-1.0));
  const T zero(0.0);
  const T effective = larger(larger(duty, -duty) - c_.dead_band, zero);
  const T driver_v = with_sign(effective * larger(in.supply_v - c_.drop, zero), duty);
  Motor m{(c_.inductance_over_h * s.current_a + driver_v) * c_.inverse_impedance,
          -(c_.back_emf * c_.inverse_impedance)};
  if (in.bridge == Bridge::open) {
    const auto idle = effective <= zero;
    m.free_current = select(idle, zero, m.free_current);
    m.current_per_speed = select(idle, C(0.0), m.current_per_speed);
  }
  return m;
}

template <class T, class C>
auto BasicThrottlePlant<T, C>::load(const T& angle, const Input& in) const noexcept -> Load {
  const T zero(0.0);
  const C h = C(step_s_);
  const T x = angle - c_.limp_home;
  const dynamics::SpringLoad<T, C> spring = dynamics::limp_home_spring(x, c_.above, c_.below, c_.inverse_ramp);
  const T below_stop = larger(c_.closed - angle, zero);
  const T beyond_stop = larger(angle - c_.open, zero);
  Load l{};
  l.spring = spring.elastic + spring.preload;
  l.spring_implicit = h * (spring.stiffness + spring.ramp_stiffness);
  l.stop = c_.stop * (below_stop - beyond_stop);
  l.stop_implicit = select(below_stop + beyond_stop > zero, c_.stop_implicit, C(0.0));
  l.air = in.airflow_torque_nm;
  if (flows_) {
    l.air += c_.air_torque * airflow_share(angle);
  }
  l.torque = l.stop + l.air - l.spring;
  l.implicit = l.spring_implicit + l.stop_implicit;
  return l;
}

template <class T, class C>
void BasicThrottlePlant<T, C>::step(State& s, const Input& in, Torques& torques) const noexcept {
  if (backlash_ == Backlash::compliance) {
    step_two_masses(s, in, torques);
  } else {
    step_one_mass(s, in, torques);
  }
}

template <class T, class C>
void BasicThrottlePlant<T, C>::step_one_mass(State& s, const Input& in, Torques& torques) const noexcept {
  const T h = T(step_s_);
  const Motor m = motor(s, in);
  const Load l = load(s.angle_rad, in);
  const C divisor = c_.inertia_over_h + c_.whole.viscous - c_.torque_constant * m.current_per_speed + l.implicit;
  const T momentum = c_.inertia_over_h * s.speed_rad_per_s + c_.torque_constant * m.free_current + l.torque;
  const T w = friction(c_.whole, c_.inertia_over_h, s.speed_rad_per_s, momentum, divisor, s.bristle_rad);
  s.speed_rad_per_s = w;
  s.angle_rad += h * w;
  s.current_a = m.free_current + m.current_per_speed * w;
  s.plate_speed_rad_per_s = w;
  s.plate_angle_rad =
      backlash_ == Backlash::hysteresis ? dynamics::play(s.angle_rad, T(c_.half_gap), s.plate_angle_rad) : s.angle_rad;
  torques = {c_.torque_constant * s.current_a, c_.whole.viscous * w,         momentum - divisor * w,
             l.spring + l.spring_implicit * w, l.stop - l.stop_implicit * w, l.air};
}

// Motor and gear on one side of the gap, plate with springs, stops and air on the other. The contact is linearly
// implicit in both speeds; the sweeps converge with ratio (h k + c)^2 h^2/(J_m J_p), below 0.1 at 1 ms.
template <class T, class C>
void BasicThrottlePlant<T, C>::step_two_masses(State& s, const Input& in, Torques& torques) const noexcept {
  constexpr int sweeps = 4;
  const T zero(0.0);
  const T h = T(step_s_);
  const Motor m = motor(s, in);
  const Load l = load(s.plate_angle_rad, in);
  const T gap = s.angle_rad - s.plate_angle_rad;
  const T over = larger(gap, -gap) - c_.half_gap;
  const T elastic = with_sign(c_.gear * larger(over, zero), gap);
  const T approach =
      select(gap < zero, s.plate_speed_rad_per_s - s.speed_rad_per_s, s.speed_rad_per_s - s.plate_speed_rad_per_s);
  // Teeth push and never pull.
  const auto closed = over > zero;
  const auto pushes = c_.gear * over + c_.gear_damping * approach > zero;
  const auto touches = closed & pushes;
  const T contact = select(touches, elastic, zero);
  const C coupling = select(touches, c_.gear_implicit, C(0.0));

  const C motor_divisor =
      c_.motor_inertia_over_h + c_.motor_side.viscous - c_.torque_constant * m.current_per_speed + coupling;
  const C plate_divisor = c_.plate_inertia_over_h + c_.plate_side.viscous + l.implicit + coupling;
  const T motor_known = c_.motor_inertia_over_h * s.speed_rad_per_s + c_.torque_constant * m.free_current - contact;
  const T plate_known = c_.plate_inertia_over_h * s.plate_speed_rad_per_s + l.torque + contact;
  T w = s.speed_rad_per_s;
  T plate_w = s.plate_speed_rad_per_s;
  T bristle = s.bristle_rad;
  T plate_bristle = s.plate_bristle_rad;
  T held = zero;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bristle = s.bristle_rad;
    plate_bristle = s.plate_bristle_rad;
    const T motor_momentum = motor_known + coupling * plate_w;
    w = friction(c_.motor_side, c_.motor_inertia_over_h, s.speed_rad_per_s, motor_momentum, motor_divisor, bristle);
    const T plate_momentum = plate_known + coupling * w;
    plate_w = friction(c_.plate_side, c_.plate_inertia_over_h, s.plate_speed_rad_per_s, plate_momentum, plate_divisor,
                       plate_bristle);
    held = motor_momentum - motor_divisor * w + plate_momentum - plate_divisor * plate_w;
  }
  s.speed_rad_per_s = w;
  s.plate_speed_rad_per_s = plate_w;
  s.angle_rad += h * w;
  s.plate_angle_rad += h * plate_w;
  s.bristle_rad = bristle;
  s.plate_bristle_rad = plate_bristle;
  s.current_a = m.free_current + m.current_per_speed * w;
  torques = {c_.torque_constant * s.current_a,
             c_.motor_side.viscous * w + c_.plate_side.viscous * plate_w,
             held,
             l.spring + l.spring_implicit * plate_w,
             l.stop - l.stop_implicit * plate_w,
             l.air};
}

}  // namespace mgdd::throttle
