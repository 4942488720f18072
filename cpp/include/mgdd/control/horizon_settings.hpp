// What a receding horizon weighs and keeps to: weights, limits of the input, of its change and of the output, and how
// long it may search. Units are those of the model: output, input, samples. Offline code.
#pragma once

#include <cstddef>
#include <span>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"

namespace mgdd::control {

struct HorizonSettings {
  double output_weight = 1.0;    ///< of the squared error of each output but the last
  double terminal_weight = 1.0;  ///< of that of the last output
  double input_weight = 0.0;     ///< of the squared input
  double change_weight = 1e-3;   ///< of its squared change from sample to sample
  double lower = -1.0;           ///< of the input
  double upper = 1.0;
  double largest_change = unbounded;  ///< of the input from sample to sample, also from the last applied one
  double least_output = -unbounded;   ///< soft: beyond, each squared excess costs output_limit_weight
  double largest_output = unbounded;
  double output_limit_weight = 0.0;  ///< 0: no bounds
  double tolerance = 1e-6;           ///< converged where the largest change of an input is below
  int max_iterations = 1;            ///< linearisations per sample; 1 is the real-time iteration, without line search
  int max_sweeps = 60;               ///< of the quadratic program, per iteration

  bool operator==(const HorizonSettings&) const = default;
};

/// The real numbers of the settings, in the order in which Python shows them.
std::span<const Field<HorizonSettings>> horizon_fields() noexcept;

/// ParameterError naming field, value and bound.
void validate(const HorizonSettings& settings);

/// How the search of a sample ended.
enum class HorizonStatus {
  converged,        ///< of one iteration: its quadratic program is solved
  iteration_limit,  ///< the inputs are feasible and the best so far
  not_finite,       ///< a state, reference or prediction: the last input is repeated
};

}  // namespace mgdd::control
