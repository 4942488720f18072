// Smooth twin of the throttle plant for optimisers: friction and limp-home preload are hyperbolic tangents, so that the
// right-hand side has exact derivatives everywhere. SI units and rad; the output is the angle in deg. It creeps under
// load where a set-valued friction sticks (speed below about width times load/friction). Allocation-free, noexcept.
// Motor, gear, spring and limp-home as in throttle/plant.hpp, with tanh in place of the sign.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace mgdd::throttle {

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

  template <class T>
  std::array<T, 3> derivative(const std::array<T, 10>& p, const std::array<T, 3>& x,
                              const std::array<double, 1>& duty) const noexcept {
    using std::tanh;
    const T deflection = x[0] - p[7];
    const T torque = gear_ratio * (p[0] * x[2]) - p[1] * x[1] - p[2] * tanh(x[1] / p[3]) - p[4] * deflection -
                     p[5] * tanh(deflection / p[6]);
    return {x[1], torque / inertia_kgm2,
            (supply_v * duty[0] - p[9] * x[2] - gear_ratio * (p[8] * x[1])) / inductance_h};
  }

  template <class T>
  T output(const std::array<T, 10>&, const std::array<T, 3>& x, const std::array<double, 1>&) const noexcept {
    return x[0] * (180.0 / std::numbers::pi);
  }

  bool operator==(const SmoothPlant&) const = default;
};

/// A throttle of passenger-car size for tests and benchmarks, in the order of `parameter_names`.
inline constexpr std::array<double, 10> smooth_plant_example{0.016, 4e-3, 0.12, 0.5,   0.12,
                                                             0.25,  0.02, 0.14, 0.016, 1.2};

}  // namespace mgdd::throttle
