// Motor-driven linear axis with friction: mass, viscous friction per direction, Coulomb friction with a Stribeck rise,
// and an offset force that may drift. Units SI, input V, output m. A StepModel: step() is noexcept and heap-free.
// Friction at rest is set-valued and solved exactly by a proximal step, so the axis neither chatters nor creeps. The
// Stribeck term falls exponentially with the speed.
#pragma once

#include <array>
#include <cmath>

#include "mgdd/common/field.hpp"
#include "mgdd/identify/free_run_fit.hpp"
#include "mgdd/identify/step_model.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::systems {

using identify::StepModel;
using identify::Values;

struct DriveAxis {
  static constexpr int n_states = 3;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 9;

  static constexpr std::array<FieldInfo, 9> parameters = {{
      {"mass_kg", "kg", closed(1e-3, 1e5), "moved mass"},
      {"viscous_ns_per_m", "N s/m", closed(0.0, 1e6), "viscous friction, mean of both directions"},
      {"viscous_asymmetry_ns_per_m", "N s/m", closed(-1e6, 1e6), "added to it forward, taken off backward"},
      {"coulomb_n", "N", closed(0.0, 1e5), "Coulomb friction"},
      {"stribeck_n", "N", closed(0.0, 1e5), "rise of the friction towards rest"},
      {"stribeck_speed_m_per_s", "m/s", closed(1e-3, 1e2), "speed of that rise"},
      {"offset_n", "N", closed(-1e5, 1e5), "constant force"},
      {"offset_drift_n_per_s", "N/s", closed(-1e3, 1e3), "its drift"},
      {"stiffness_n_per_m", "N/m", closed(-1e6, 1e6), "stiffness about the centre"},
  }};
  /// time_s is the time since the start of the record: the drift needs it, a fit leaves it fixed.
  static constexpr std::array<FieldInfo, 3> states = {{{"position_m", "m", closed(-1e3, 1e3), "position"},
                                                       {"speed_m_per_s", "m/s", closed(-1e3, 1e3), "speed"},
                                                       {"time_s", "s", closed(0.0, 1e9), "time since the start"}}};

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
