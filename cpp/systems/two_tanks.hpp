// Two tanks in a row under a pump, with overflow: levels in the unit of the level sensor (V), pump input V, time s.
// A StepModel: step() is noexcept and heap-free. Balance of a tank: Torricelli's law with a free exponent and a free
// datum instead of the square root, because outlet pipes are neither sharp-edged nor level with the sensor's zero.
// Overflow as in Schoukens and Noël 2017: what leaves the upper tank over its brim lands in the lower one in part.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "mgdd/identify/free_run_fit.hpp"
#include "mgdd/identify/step_model.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::systems {

using identify::FitDomain;
using identify::StepModel;
using identify::Values;

struct TwoTanks {
  static constexpr int n_states = 4;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 9;

  static constexpr std::array<FitDomain, 9> parameters = {{
      {"pump_per_s", 1e-5, 10.0},           // level rate per pump volt
      {"upper_outflow_per_s", 1e-6, 10.0},  // k1 in k1 x1^p1
      {"upper_exponent", 0.05, 2.0},
      {"lower_outflow_per_s", 1e-6, 10.0},
      {"lower_exponent", 0.05, 2.0},
      {"lower_datum_v", -5.0, 5.0},  // reading at which the lower outlet runs dry
      {"upper_brim_v", 1.0, 200.0},
      {"overflow_share", 0.0, 1.0},  // of the upper overflow that lands in the lower tank
      {"delay_samples", 0.0, 2.0},   // of the pump, interpolated
  }};
  /// The upper level is not measured: its unit is that of the lower level times the ratio of the floor areas.
  static constexpr std::array<FitDomain, 4> states = {{{"upper_level_v", 0.0, 200.0},
                                                       {"lower_level_v", -5.0, 20.0},
                                                       {"pump_before_v", -100.0, 100.0},
                                                       {"pump_before_that_v", -100.0, 100.0}}};

  double lower_brim_v = 10.0;  ///< the lower tank runs over here, and the sensor ends here
  int substeps = 10;           ///< of the explicit Euler step; the tanks' time constants are minutes

  template <class T>
  Values<T, 4> step(const Values<T, 9>& p, const Values<T, 4>& state, const Values<double, 1>& input,
                    double dt_s) const noexcept {
    const auto& [pump, k_upper, e_upper, k_lower, e_lower, datum, brim, share, delay] = p;
    auto [upper, lower, before, before_that] = state;
    const bool within_one = value_of(delay) <= 1.0;
    const T voltage =
        within_one ? input[0] + delay * (before - input[0]) : before + (delay - 1.0) * (before_that - before);
    const T inflow = value_of(voltage) > 0.0 ? pump * voltage : T(0.0);
    const double h = dt_s / substeps;
    for (int k = 0; k < substeps; ++k) {
      const T out_upper = outflow<T>(k_upper, upper, e_upper);
      const T out_lower = outflow<T>(k_lower, lower - datum, e_lower);
      upper += h * (inflow - out_upper);
      T gain = h * (out_upper - out_lower);
      if (upper > brim) {
        gain += share * (upper - brim);
        upper = brim;
      }
      if (value_of(upper) < 0.0) upper = T(0.0);
      lower += gain;
      if (value_of(lower) > lower_brim_v) lower = T(lower_brim_v);
    }
    return {upper, lower, T(input[0]), before};
  }

  template <class T>
  T output(const Values<T, 9>&, const Values<T, 4>& state, const Values<double, 1>&) const noexcept {
    return state[1];
  }

 private:
  template <class T>
  static T outflow(const T& factor, const T& level, const T& exponent) noexcept {
    using std::pow;
    return value_of(level) > 0.0 ? factor * pow(level, exponent) : T(0.0);
  }
};

static_assert(StepModel<TwoTanks>);

}  // namespace mgdd::systems
