#include "mgdd/optimize/least_squares/parameter.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

void require(bool holds, const char* field, double value, const char* bound) {
  if (!holds) {
    throw ParameterError(std::string(field) + " = " + text(value) + ": must be " + bound);
  }
}

}  // namespace

void LeastSquaresOptions::validate() const {
  require(max_iterations >= 1 && max_iterations <= iteration_ceiling, "max_iterations", max_iterations,
          "in 1..1000000");
  require(cost_tolerance >= 0.0 && cost_tolerance < 1.0, "cost_tolerance", cost_tolerance, "in [0, 1)");
  require(step_tolerance >= 0.0 && step_tolerance < 1.0, "step_tolerance", step_tolerance, "in [0, 1)");
  require(gradient_tolerance >= 0.0 && gradient_tolerance < 1.0, "gradient_tolerance", gradient_tolerance, "in [0, 1)");
  require(initial_damping >= least_damping && initial_damping <= largest_damping, "initial_damping", initial_damping,
          "in [1e-24, 1e30]");
  require(correlation_limit > 0.0 && correlation_limit <= 1.0, "correlation_limit", correlation_limit, "in (0, 1]");
  require(rank_tolerance >= epsilon && rank_tolerance < 1.0, "rank_tolerance", rank_tolerance, "in [2.2e-16, 1)");
}

void validate(const std::vector<Parameter>& parameters) {
  if (parameters.empty()) {
    throw ParameterError("parameters is empty: name at least one");
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    if (p.name.empty()) {
      throw ParameterError("parameter " + std::to_string(i) + " has no name");
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (parameters[k].name == p.name) {
        throw ParameterError("parameter name '" + p.name + "' appears twice: names must be unique");
      }
    }
    if (!(p.lower < p.upper)) {
      throw ParameterError(p.name + ": lower = " + text(p.lower) + " must be < upper = " + text(p.upper));
    }
    if (p.log_scaled && !(p.lower > 0.0)) {
      throw ParameterError(p.name + ": lower = " + text(p.lower) + " must be > 0 for a log-scaled parameter");
    }
  }
}

void validate_start(const std::vector<Parameter>& parameters, const Eigen::VectorXd& start) {
  if (start.size() != static_cast<Eigen::Index>(parameters.size())) {
    throw ShapeError("start has " + std::to_string(start.size()) + " values for " + std::to_string(parameters.size()) +
                     " parameters");
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    const double value = start[static_cast<Eigen::Index>(i)];
    if (!std::isfinite(value) || value < p.lower || value > p.upper) {
      throw ParameterError("start of " + p.name + " = " + text(value) + ": must be finite and in [" + text(p.lower) +
                           ", " + text(p.upper) + "]");
    }
  }
}

}  // namespace mgdd::optimize
