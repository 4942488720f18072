// First-principle throttle in the groups that duty and angle determine, one number per group, both sides of limp-home:
// tau = J/b, G = g/J, beta = T_pt/g, kappa = k_s/g, delta = T_d/g, limp-home angle and electrical time L/R. Set-valued
// friction solved exactly in each step; derivatives by duals, zero while the plate sticks. Working units deg, s, duty.
// noexcept, no heap. Method as in throttle/plant.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include "mgdd/identify/multi_start.hpp"
#include "mgdd/identify/step_model.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::identify {

struct ThrottleGroups {
  static constexpr int n_states = 3;  ///< angle [deg], speed [deg/s], motor torque over stall torque [-]
  static constexpr int n_inputs = 1;  ///< duty [-]
  static constexpr int n_parameters = 9;
  static constexpr std::array<std::string_view, 9> parameter_names{
      "tau_s",       "gain_deg_per_s2_per_duty", "beta_above_duty",          "kappa_above_duty_per_deg",
      "delta_duty",  "beta_below_duty",          "kappa_below_duty_per_deg", "limp_home_deg",
      "electrical_s"};

  double closed_deg = 0.0;
  double open_deg = 90.0;
  double ramp_deg = 0.25;  ///< half width of the preload's ramp
  int substeps = 2;
  double tanh_deg_per_s = 0.0;  ///< > 0: smooth friction tanh(speed/this), for derivative checks; it creeps

  template <class T>
  Values<T, 3> step(const Values<T, 9>& p, Values<T, 3> x, const Values<double, 1>& duty, double dt_s) const noexcept {
    using std::tanh;
    const double h = dt_s / substeps;
    const T over_tau = 1.0 / p[0];
    for (int k = 0; k < substeps; ++k) {
      const T deflection = x[0] - p[7];
      const bool above = value_of(deflection) >= 0.0;
      const T& beta = above ? p[2] : p[5];
      const T& kappa = above ? p[3] : p[6];
      const double reach = value_of(deflection) / ramp_deg;
      const T ramp = reach > 1.0 ? T(1.0) : reach < -1.0 ? T(-1.0) : deflection / ramp_deg;
      const T lag = p[8] / h;
      const T share = 1.0 / (1.0 + lag);  // of the new current that follows the voltage
      const T free_torque = share * (lag * x[2] + duty[0]);
      T load = free_torque - ramp * beta - kappa * deflection;
      T divisor = 1.0 + (h * over_tau) * share + (h * h) * (p[1] * kappa);
      T push = x[1] + h * (p[1] * load);  // speed if there were no friction and no damping
      const T limit = h * (p[1] * p[4]);
      T speed(0.0);
      if (tanh_deg_per_s > 0.0) {
        speed = (push - limit * tanh(x[1] / tanh_deg_per_s)) / divisor;
      } else if (value_of(push) > value_of(limit)) {
        speed = (push - limit) / divisor;
      } else if (value_of(push) < -value_of(limit)) {
        speed = (push + limit) / divisor;
      }
      x[0] += h * speed;
      x[1] = speed;
      x[2] = free_torque - share * (speed * over_tau / p[1]);
      if (value_of(x[0]) < closed_deg || value_of(x[0]) > open_deg) {
        x[0] = T(value_of(x[0]) < closed_deg ? closed_deg : open_deg);
        x[1] = T(0.0);
      }
    }
    return x;
  }

  template <class T>
  T output(const Values<T, 9>&, const Values<T, 3>& x, const Values<double, 1>&) const noexcept {
    return x[0];
  }
};

/// Bounds of the nine groups; all are searched as logarithms but the limp-home angle and the electrical time.
std::vector<optimize::Parameter> throttle_group_parameters();

/// Staged fit from every start; values of the best start and all reports (last stage).
struct ThrottleGroupsFit {
  Values<double, 9> values{};
  MultiStartFit starts;
};
ThrottleGroupsFit fit_throttle_groups(const ThrottleGroups& model, const std::vector<SimulationRecord>& records,
                                      const std::vector<FitStage>& stages, const std::vector<Values<double, 9>>& starts,
                                      std::size_t n_threads);

/// Free run on every sample.
std::vector<double> simulate(const ThrottleGroups& model, const Values<double, 9>& values, double dt_s,
                             const Values<double, 3>& start, const std::vector<double>& duty);

}  // namespace mgdd::identify
