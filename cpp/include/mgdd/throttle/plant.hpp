// Electronic throttle body as a plant: fixed-step simulation that sticks exactly, never chatters and never creeps.
// `step` is noexcept and allocation-free for every option. SI and radians inside. The scalar T is double, or Lanes<N>
// for N throttles or N runs at once, with the same bits in every lane.
// Method: semi-implicit step, linearly implicit in motor, viscous friction, springs and stops; the set-valued friction
// is solved exactly (Moreau 1988; Brogliato and Tanwani 2020, section 5). First order in the step, 0.1 ms by default.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>

#include "mgdd/common/units.hpp"
#include "mgdd/math/lanes.hpp"
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

template <class T>
struct FrictionCoefficients {
  T viscous, coulomb, stiction;
};

/// What one step needs of the parameters, in SI. Every member is a T, so that lanes are packed as columns.
template <class T>
struct PlantCoefficients {
  FrictionCoefficients<T> whole, motor_side, plate_side;
  T inertia_over_h, motor_inertia_over_h, plate_inertia_over_h;
  T torque_constant, back_emf, inverse_impedance, inductance_over_h;
  T drop, dead_band;
  T inverse_stribeck, karnopp, inverse_tanh, bristle, bristle_damping;
  T limp_home, spring_above, spring_below, preload_above, preload_below, inverse_ramp;
  T closed, open, stop, stop_implicit;
  T half_gap, gear, gear_damping, gear_implicit;
  T air_torque;  ///< -D^3 dp
  T supply;
};

PlantCoefficients<double> plant_coefficients(const Throttle& throttle, double step_s) noexcept;

template <class T>
class BasicThrottlePlant {
 public:
  using State = BasicThrottleState<T>;
  using Input = BasicThrottleInput<T>;
  using Torques = BasicThrottleTorques<T>;

  /// ParameterError for a bad parameter or a step outside [1e-6, 5e-3] s.
  explicit BasicThrottlePlant(const Throttle& throttle, double step_s = default_step_s)
    requires std::same_as<T, double>;

  /// From prepared coefficients; `options` gives the forms of friction and backlash, the same in every lane.
  BasicThrottlePlant(const PlantCoefficients<T>& coefficients, const Throttle& options, double step_s) noexcept
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

  double step_s() const noexcept { return step_s_; }
  const PlantCoefficients<T>& coefficients() const noexcept { return c_; }

 private:
  struct Motor {
    T free_current;  ///< current at the next instant if the plate stood still
    T current_per_speed;
  };
  struct Load {
    T torque;    ///< spring, stops and air at the present angle
    T implicit;  ///< what multiplies the next speed
    T spring, spring_implicit, stop, stop_implicit, air;
  };
  MGDD_INLINE Motor motor(const State& s, const Input& in) const noexcept;
  MGDD_INLINE Load load(const T& angle, const Input& in) const noexcept;
  MGDD_INLINE T level(const FrictionCoefficients<T>& f, const T& speed) const noexcept;
  MGDD_INLINE T next_speed(const FrictionCoefficients<T>& f, const T& inertia_over_h, const T& speed, const T& momentum,
                           const T& divisor, T& bristle) const noexcept;
  MGDD_INLINE void step_one_mass(State& s, const Input& in, Torques& torques) const noexcept;
  MGDD_INLINE void step_two_masses(State& s, const Input& in, Torques& torques) const noexcept;

  PlantCoefficients<T> c_;
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

// --- the step -------------------------------------------------------------------------------------------------

template <class T>
auto BasicThrottlePlant<T>::motor(const State& s, const Input& in) const noexcept -> Motor {
  const T duty = larger(smaller(in.duty, T(1.0)), T(-1.0));
  const T zero(0.0);
  const T effective = larger(larger(duty, -duty) - c_.dead_band, zero);
  const T driver_v = with_sign(effective * larger(in.supply_v - c_.drop, zero), duty);
  Motor m{(c_.inductance_over_h * s.current_a + driver_v) * c_.inverse_impedance,
          -(c_.back_emf * c_.inverse_impedance)};
  if (in.bridge == Bridge::open) {
    m.free_current = select(effective <= zero, zero, m.free_current);
    m.current_per_speed = select(effective <= zero, zero, m.current_per_speed);
  }
  return m;
}

template <class T>
auto BasicThrottlePlant<T>::load(const T& angle, const Input& in) const noexcept -> Load {
  const T zero(0.0);
  const T one(1.0);
  const T h(step_s_);
  const T x = angle - c_.limp_home;
  const auto above = x >= zero;
  const T spring = select(above, c_.spring_above, c_.spring_below);
  const T preload = select(above, c_.preload_above, c_.preload_below);
  const T ramp = x * c_.inverse_ramp;
  const T share = larger(smaller(ramp, one), -one);
  const T slope = spring + select(share == ramp, preload * c_.inverse_ramp, zero);
  const T below_stop = larger(c_.closed - angle, zero);
  const T beyond_stop = larger(angle - c_.open, zero);
  Load l{};
  l.spring = spring * x + preload * share;
  l.spring_implicit = h * slope;
  l.stop = c_.stop * (below_stop - beyond_stop);
  l.stop_implicit = select(below_stop + beyond_stop > zero, c_.stop_implicit, zero);
  l.air = in.airflow_torque_nm;
  if (flows_) {
    l.air += c_.air_torque * each(angle, [](double rad) { return airflow_coefficient(rad / units::rad_per_deg); });
  }
  l.torque = l.stop + l.air - l.spring;
  l.implicit = l.spring_implicit + l.stop_implicit;
  return l;
}

// Stribeck curve (Armstrong-Helouvry et al. 1994, eq. 3 with exponent 2).
template <class T>
T BasicThrottlePlant<T>::level(const FrictionCoefficients<T>& f, const T& speed) const noexcept {
  const T ratio = speed * c_.inverse_stribeck;
  return f.coulomb + (f.stiction - f.coulomb) * each(ratio, [](double r) { return std::exp(-r * r); });
}

// Speed after a step with `momentum` = inertia/h speed + all torques but dry friction, over `divisor`. Exact for the
// set-valued forms: what friction can hold stays at rest, what it cannot hold slides with the sign of the momentum.
template <class T>
T BasicThrottlePlant<T>::next_speed(const FrictionCoefficients<T>& f, const T& inertia_over_h, const T& speed,
                                    const T& momentum, const T& divisor, T& bristle) const noexcept {
  const T zero(0.0);
  const T force = larger(momentum, -momentum);
  const T size = larger(speed, -speed);
  const T rest(1e-9);  // rad/s: below it the plate counts as stuck
  switch (friction_) {
    case Friction::coulomb:
      return select(force <= f.coulomb, zero, (momentum - with_sign(f.coulomb, momentum)) / divisor);
    case Friction::stiction: {
      const T hold = select(size < rest, f.stiction, f.coulomb);
      return select(force <= hold, zero, (momentum - with_sign(f.coulomb, momentum)) / divisor);
    }
    case Friction::stribeck: {
      const T curve = level(f, speed);
      const T slide = select(size < rest, f.coulomb, curve);
      const T hold = select(size < rest, f.stiction, curve);
      return select(force <= hold, zero, (momentum - with_sign(slide, momentum)) / divisor);
    }
    case Friction::karnopp: {
      const T net = momentum - inertia_over_h * speed;
      const auto in_band = size < c_.karnopp;
      const auto holds = in_band & (larger(net, -net) <= f.stiction);
      const T slide = select(in_band, with_sign(f.coulomb, net), with_sign(level(f, speed), speed));
      const T moved = (momentum - slide) / divisor;
      // A reversal inside one step stops at zero: friction never drives.
      const auto reversed = (!in_band) & (moved * speed < zero);
      return select(holds | reversed, zero, moved);
    }
    case Friction::tanh: {
      const T t = each(speed * c_.inverse_tanh, [](double r) { return std::tanh(r); });
      const T slope = f.coulomb * c_.inverse_tanh * (T(1.0) - t * t);
      return (momentum - f.coulomb * t + slope * speed) / (divisor + slope);
    }
    case Friction::lugre: {
      const T h(step_s_);
      const T per_h = c_.bristle_damping / h;
      const T keep = T(1.0) / (T(1.0) + h * c_.bristle * size / level(f, speed));
      const T grip = (c_.bristle + per_h) * keep;
      const T moved = (momentum - (grip - per_h) * bristle) / (divisor + grip * h);
      bristle = keep * (bristle + h * moved);
      return moved;
    }
  }
  return zero;
}

template <class T>
void BasicThrottlePlant<T>::step(State& s, const Input& in, Torques& torques) const noexcept {
  if (backlash_ == Backlash::compliance) {
    step_two_masses(s, in, torques);
  } else {
    step_one_mass(s, in, torques);
  }
}

template <class T>
void BasicThrottlePlant<T>::step_one_mass(State& s, const Input& in, Torques& torques) const noexcept {
  const T h(step_s_);
  const Motor m = motor(s, in);
  const Load l = load(s.angle_rad, in);
  const T divisor = c_.inertia_over_h + c_.whole.viscous - c_.torque_constant * m.current_per_speed + l.implicit;
  const T momentum = c_.inertia_over_h * s.speed_rad_per_s + c_.torque_constant * m.free_current + l.torque;
  const T w = next_speed(c_.whole, c_.inertia_over_h, s.speed_rad_per_s, momentum, divisor, s.bristle_rad);
  s.speed_rad_per_s = w;
  s.angle_rad += h * w;
  s.current_a = m.free_current + m.current_per_speed * w;
  s.plate_speed_rad_per_s = w;
  s.plate_angle_rad = backlash_ == Backlash::hysteresis
                          ? larger(smaller(s.plate_angle_rad, s.angle_rad + c_.half_gap), s.angle_rad - c_.half_gap)
                          : s.angle_rad;
  torques = {c_.torque_constant * s.current_a, c_.whole.viscous * w,         momentum - divisor * w,
             l.spring + l.spring_implicit * w, l.stop - l.stop_implicit * w, l.air};
}

// Motor and gear on one side of the gap, plate with springs, stops and air on the other. The contact is linearly
// implicit in both speeds; the sweeps converge with ratio (h k + c)^2 h^2/(J_m J_p), below 0.1 at 1 ms.
template <class T>
void BasicThrottlePlant<T>::step_two_masses(State& s, const Input& in, Torques& torques) const noexcept {
  constexpr int sweeps = 4;
  const T zero(0.0);
  const T h(step_s_);
  const Motor m = motor(s, in);
  const Load l = load(s.plate_angle_rad, in);
  const T gap = s.angle_rad - s.plate_angle_rad;
  const T over = larger(gap, -gap) - c_.half_gap;
  const T elastic = with_sign(c_.gear * larger(over, zero), gap);
  const T approach =
      select(gap < zero, s.plate_speed_rad_per_s - s.speed_rad_per_s, s.speed_rad_per_s - s.plate_speed_rad_per_s);
  // Teeth push and never pull.
  const auto touches = (over > zero) & (c_.gear * over + c_.gear_damping * approach > zero);
  const T contact = select(touches, elastic, zero);
  const T coupling = select(touches, c_.gear_implicit, zero);

  const T motor_divisor =
      c_.motor_inertia_over_h + c_.motor_side.viscous - c_.torque_constant * m.current_per_speed + coupling;
  const T plate_divisor = c_.plate_inertia_over_h + c_.plate_side.viscous + l.implicit + coupling;
  const T motor_known = c_.motor_inertia_over_h * s.speed_rad_per_s + c_.torque_constant * m.free_current - contact;
  const T plate_known = c_.plate_inertia_over_h * s.plate_speed_rad_per_s + l.torque + contact;
  T w = s.speed_rad_per_s;
  T plate_w = s.plate_speed_rad_per_s;
  T bristle = s.bristle_rad;
  T plate_bristle = s.plate_bristle_rad;
  T friction = zero;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bristle = s.bristle_rad;
    plate_bristle = s.plate_bristle_rad;
    const T motor_momentum = motor_known + coupling * plate_w;
    w = next_speed(c_.motor_side, c_.motor_inertia_over_h, s.speed_rad_per_s, motor_momentum, motor_divisor, bristle);
    const T plate_momentum = plate_known + coupling * w;
    plate_w = next_speed(c_.plate_side, c_.plate_inertia_over_h, s.plate_speed_rad_per_s, plate_momentum, plate_divisor,
                         plate_bristle);
    friction = motor_momentum - motor_divisor * w + plate_momentum - plate_divisor * plate_w;
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
             friction,
             l.spring + l.spring_implicit * plate_w,
             l.stop - l.stop_implicit * plate_w,
             l.air};
}

}  // namespace mgdd::throttle
