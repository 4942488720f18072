// Motor-driven linear axis with friction: mass, viscous friction per direction, Coulomb friction with a Stribeck rise,
// and an offset force that may drift. Units SI, input V, output m. A StepModel: step() is noexcept and heap-free.
// Friction at rest is set-valued and solved exactly by a proximal step, so the axis neither chatters nor creeps. The
// Stribeck term falls exponentially with the speed.
#pragma once

#include <array>
#include <cmath>
#include <string_view>

#include "mgdd/identify/free_run_fit.hpp"
#include "mgdd/identify/step_model.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::systems {

using identify::FitDomain;
using identify::StepModel;
using identify::Values;

struct DriveAxis {
  static constexpr int n_states = 3;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 9;

  static constexpr std::array<FitDomain, 9> parameters = {{
      {"mass_kg", 1e-3, 1e5},
      {"viscous_ns_per_m", 0.0, 1e6},
      {"viscous_asymmetry_ns_per_m", -1e6, 1e6},  // forward: viscous + this; backward: viscous - this
      {"coulomb_n", 0.0, 1e5},
      {"stribeck_n", 0.0, 1e5},
      {"stribeck_speed_m_per_s", 1e-3, 1e2},
      {"offset_n", -1e5, 1e5},
      {"offset_drift_n_per_s", -1e3, 1e3},
      {"stiffness_n_per_m", -1e6, 1e6},
  }};
  /// time_s is the time since the start of the record: the drift needs it, a fit leaves it fixed.
  static constexpr std::array<FitDomain, 3> states = {
      {{"position_m", -1e3, 1e3}, {"speed_m_per_s", -1e3, 1e3}, {"time_s", 0.0, 1e9}}};

  double force_n_per_v = 1.0;  ///< actuator gain; only its ratio to the mass and the forces acts
  double centre_m = 0.0;       ///< where the stiffness exerts no force

  template <class T>
  Values<T, 3> step(const Values<T, 9>& p, const Values<T, 3>& state, const Values<double, 1>& input,
                    double dt_s) const noexcept {
    using std::exp;
    const auto& [mass, viscous, asymmetry, coulomb, stribeck, stribeck_speed, offset, drift, stiffness] = p;
    const auto& [position, speed, time] = state;
    const T drive = mass * (1.0 / dt_s) * speed + force_n_per_v * input[0] - offset - drift * time -
                    stiffness * (position - centre_m);
    const bool ahead = value_of(drive) > 0.0;
    T limit = coulomb;
    if (value_of(stribeck) > 0.0) limit += stribeck * exp((value_of(speed) > 0.0 ? -speed : speed) / stribeck_speed);
    T next(0.0);
    if (ahead && drive > limit) {
      next = (drive - limit) / (mass * (1.0 / dt_s) + viscous + asymmetry);
    } else if (!ahead && drive < -limit) {
      next = (drive + limit) / (mass * (1.0 / dt_s) + viscous - asymmetry);
    }
    return {position + dt_s * next, next, time + dt_s};
  }

  template <class T>
  T output(const Values<T, 9>&, const Values<T, 3>& state, const Values<double, 1>&) const noexcept {
    return state[0];
  }
};

static_assert(StepModel<DriveAxis>);

}  // namespace mgdd::systems
