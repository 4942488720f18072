// Runs of a throttle over sampled inputs: one at a time, or many at once in SIMD lanes with the same bits.
// Column k of the result is the state at sample k; the inputs of sample k act until sample k + 1. SI inside the states.
// `simulate` on prepared columns is noexcept and allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/throttle/plant.hpp"
#include "mgdd/throttle/plant_lanes.hpp"

namespace mgdd::throttle {

/// Inputs per sample. `supply_v` and `airflow_torque_nm` may be empty: the parameter's supply, and no extra torque.
struct ThrottleSignals {
  std::span<const double> duty;
  std::span<const double> supply_v{};
  std::span<const double> airflow_torque_nm{};
  Bridge bridge = Bridge::brake;
};

/// Where the results go; an empty column is not written.
struct ThrottleColumns {
  std::span<double> angle_deg;  ///< of the plate
  std::span<double> speed_deg_per_s{};
  std::span<double> current_a{};
};

/// Samples and steps: sample_s = steps step_s. ParameterError unless that is a whole number >= 1 within 1e-9.
std::size_t steps_per_sample(double sample_s, double step_s);

/// ShapeError for columns of different length, DataError for an input that is not finite or a duty outside -1..1.
void validate(const ThrottleSignals& signals);

/// Runs one throttle; `state` ends at the last sample.
void simulate(const ThrottlePlant& plant, const ThrottleSignals& signals, std::size_t steps, ThrottleState& state,
              const ThrottleColumns& columns) noexcept;

/// Angle of the plate [deg] of every case under the same signals, case after case in rows of one column per sample.
/// All cases have the same forms of friction and backlash (ParameterError otherwise).
std::vector<double> simulate_many(std::span<const ThrottleCase> cases, const ThrottleSignals& signals,
                                  std::size_t steps, double step_s);

}  // namespace mgdd::throttle
