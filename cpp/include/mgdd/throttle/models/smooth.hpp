// Smooth twin of the throttle plant for optimisers: friction and limp-home preload are hyperbolic tangents, so that the
// right-hand side has exact derivatives everywhere. SI units and rad; the output is the angle in deg. It creeps under
// load where a set-valued friction sticks (speed below about width times load/friction). Allocation-free, noexcept.
// Motor, gear, spring and limp-home as in throttle/plant.hpp, with tanh in place of the sign.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "mgdd/dynamics/limp_home_spring.hpp"
#include "mgdd/dynamics/rk4.hpp"

namespace mgdd::throttle {

/// Coefficients of the right-hand side, divided by inertia or inductance once.
template <class C>
struct SmoothCoefficients {
  C torque, viscous, coulomb, over_width, spring, preload, over_preload_width, limp_home, emf, resistance;
  C current_to_speed;  ///< N/J
  C speed_to_current;  ///< N/L
  C over_inertia, over_inductance, supply;
};

/// Deflection from limp-home and the two tangents of a state.
template <class T>
struct SmoothRatios {
  T deflection, friction, preload;
};

/// J dw/dt = N Km i - Kv w - Tc tanh(w/ws) - ks (theta - thLH) - Tpd tanh((theta - thLH)/ths)
/// L di/dt = Vb u - R i - N Ke w,  dtheta/dt = w.  No end stops: keep the record inside the travel.
/// J, N, L and Vb are constants; the ten other numbers are the parameters, in the order of `parameter_names`.
struct SmoothPlant {
  static constexpr int n_states = 3;  ///< angle [rad], speed [rad/s], current [A]
  static constexpr int n_inputs = 1;  ///< duty [-]
  static constexpr int n_parameters = 10;
  static constexpr std::array<std::string_view, 10> parameter_names{"torque_constant_nm_per_a",  // Km, of the motor
                                                                    "viscous_nms_per_rad",       // Kv
                                                                    "coulomb_nm",                // Tc
                                                                    "friction_width_rad_per_s",  // ws
                                                                    "spring_nm_per_rad",         // ks
                                                                    "preload_nm",                // Tpd
                                                                    "preload_width_rad",         // ths
                                                                    "limp_home_rad",             // thLH
                                                                    "emf_constant_vs_per_rad",   // Ke, of the motor
                                                                    "resistance_ohm"};           // R

  double inertia_kgm2 = 2e-3;
  double gear_ratio = 20.0;
  double inductance_h = 1e-3;
  double supply_v = 12.0;

  template <class C>
  MGDD_INLINE SmoothCoefficients<C> coefficients(const std::array<C, 10>& p) const noexcept {
    SmoothCoefficients<C> c{};
    c.over_inertia = constant_of<C>(1.0 / inertia_kgm2);
    c.over_inductance = constant_of<C>(1.0 / inductance_h);
    c.current_to_speed = constant_of<C>(gear_ratio / inertia_kgm2);
    c.speed_to_current = constant_of<C>(gear_ratio / inductance_h);
    c.supply = constant_of<C>(supply_v / inductance_h);
    c.torque = p[0] * c.current_to_speed;
    c.viscous = p[1] * c.over_inertia;
    c.coulomb = p[2] * c.over_inertia;
    c.over_width = constant_of<C>(1.0) / p[3];
    c.spring = p[4] * c.over_inertia;
    c.preload = p[5] * c.over_inertia;
    c.over_preload_width = constant_of<C>(1.0) / p[6];
    c.limp_home = p[7];
    c.emf = p[8] * c.speed_to_current;
    c.resistance = p[9] * c.over_inductance;
    return c;
  }

  /// The law, of which the fit's kernel makes its hand-written derivatives: acceleration and rise of the current, with
  /// the tangents given. They come last: they are the longest chain of dependent operations.
  template <class T, class C>
  MGDD_INLINE static T acceleration(const SmoothCoefficients<C>& c, const T& speed, const T& current,
                                    const SmoothRatios<T>& r) noexcept {
    const dynamics::SmoothSpring<T> spring = dynamics::smooth_spring(r.deflection, r.preload, c.spring, c.preload);
    return ((c.torque * current - c.viscous * speed) - spring.elastic) - (c.coulomb * r.friction + spring.preload);
  }
  template <class T, class C, class D>
  MGDD_INLINE static T current_rise(const SmoothCoefficients<C>& c, const T& speed, const T& current,
                                    const D& drive) noexcept {
    return drive - c.resistance * current - c.emf * speed;
  }

  template <class T, class C, class U>
  MGDD_INLINE std::array<T, 3> derivative(const SmoothCoefficients<C>& c, const std::array<T, 3>& x,
                                          const std::array<U, 1>& duty) const noexcept {
    const T deflection = x[0] - c.limp_home;
    const SmoothRatios<T> ratios{deflection, tanh_of(x[1] * c.over_width), tanh_of(deflection * c.over_preload_width)};
    return {x[1], acceleration(c, x[1], x[2], ratios), current_rise(c, x[1], x[2], T(duty[0]) * c.supply)};
  }

  template <class T, class C>
  MGDD_INLINE T output(const SmoothCoefficients<C>&, const std::array<T, 3>& x) const noexcept {
    return x[0] * T(180.0 / std::numbers::pi);
  }

  bool operator==(const SmoothPlant&) const = default;
};

/// A throttle of passenger-car size for tests and benchmarks, in the order of `parameter_names`.
inline constexpr std::array<double, 10> smooth_plant_example{0.016, 4e-3, 0.12, 0.5,   0.12,
                                                             0.25,  0.02, 0.14, 0.016, 1.2};

}  // namespace mgdd::throttle
