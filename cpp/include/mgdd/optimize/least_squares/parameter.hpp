// What a least-squares search is told: its unknowns with their bounds, and the options of the search.
// Values stand in the units of the caller. Not real-time safe: checks throw.
#pragma once

#include <limits>
#include <stop_token>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "mgdd/common/record.hpp"

namespace mgdd::optimize {

/// One unknown. A log-scaled parameter is searched as log(p): for positive numbers known only to their order.
struct Parameter {
  std::string name;
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  bool log_scaled = false;  ///< needs lower > 0

  bool operator==(const Parameter&) const = default;
};

constexpr auto fields_of(const Parameter&) {
  using P = Parameter;
  return std::tuple{field<&P::name>("name", "in reports and messages", DefaultForm::required),
                    field<&P::lower>("lower", "lower bound, -inf for none"),
                    field<&P::upper>("upper", "upper bound, inf for none"),
                    field<&P::log_scaled>("log_scaled", "searched as log(p); needs lower > 0")};
}

/// A field as an unknown of a search, within its domain; an open bound is kept off by a millionth.
Parameter parameter_of(const FieldInfo& field, std::string name);

inline constexpr int iteration_ceiling = 1'000'000;  ///< the history is reserved for all iterations
inline constexpr double least_damping = 1e-24;       ///< rounding in a null direction, about 1e-30, stays harmless
inline constexpr double largest_damping = 1e30;

struct LeastSquaresOptions {
  /// Trial steps. Well-posed fits need 5 to 50; curved valleys from far away stay below 200.
  int max_iterations = 200;
  /// Relative decrease of the cost. 1e-12 is a move of 1e-6 sqrt(degrees of freedom) stderr: not worth a
  /// step.
  double cost_tolerance = 1e-12;
  /// Step over parameters, both scaled. Ten digits: far below any stderr, above the rounding of a simulation.
  double step_tolerance = 1e-10;
  /// Largest cosine between the residual and a free Jacobian column. Reached only by exact Jacobians.
  double gradient_tolerance = 1e-12;
  /// Relative to unit columns. 1e-3 trusts the start nearly as much as Gauss-Newton does (Nielsen 1999: 1e-6
  /// to 1).
  double initial_damping = 1e-3;
  /// Beyond 0.98 the stderr is more than five times that of the same parameter fitted alone.
  double correlation_limit = 0.98;
  /// Below 1e-10 the rounding of a Jacobian (1e-16) reaches the sixth digit of the direction.
  double rank_tolerance = 1e-10;
  /// Ask for residual and Jacobian in one call. False asks for the Jacobian only after a step was accepted.
  bool evaluate_together = true;
  /// A request ends the search before its next evaluation.
  std::stop_token stop{};

  /// Throws ParameterError naming the field, its value and its bound.
  void validate() const;

  bool operator==(const LeastSquaresOptions&) const = default;
};

constexpr auto fields_of(const LeastSquaresOptions&) {
  using O = LeastSquaresOptions;
  constexpr Domain fraction{.lower = 0.0, .upper = 1.0, .upper_open = true};
  constexpr Domain rank{.lower = std::numeric_limits<double>::epsilon(), .upper = 1.0, .upper_open = true};
  return std::tuple{
      field<&O::max_iterations>({"max_iterations", "-", closed(1.0, iteration_ceiling), "trial steps"}),
      field<&O::cost_tolerance>({"cost_tolerance", "-", fraction, "relative decrease of the cost that ends a search"}),
      field<&O::step_tolerance>({"step_tolerance", "-", fraction, "relative step that ends a search"}),
      field<&O::gradient_tolerance>({"gradient_tolerance", "-", fraction, "cosine of the gradient that ends a search"}),
      field<&O::initial_damping>({"initial_damping", "-", closed(least_damping, largest_damping),
                                  "damping of the first step, of unit columns"}),
      field<&O::correlation_limit>(
          {"correlation_limit", "-", above(0.0, 1.0), "correlation above which two are named"}),
      field<&O::rank_tolerance>({"rank_tolerance", "-", rank, "singular value, over the largest, that counts as zero"}),
      field<&O::evaluate_together>("evaluate_together", "residual and Jacobian in one call"),
  };
}

/// Throws ParameterError: empty or repeated names, NaN bounds, lower >= upper, log-scaled with lower <= 0.
void validate(const std::vector<Parameter>& parameters);

/// Throws ShapeError for a wrong length, ParameterError for a value that is not finite or outside its bounds.
void validate_start(const std::vector<Parameter>& parameters, const Eigen::VectorXd& start);

}  // namespace mgdd::optimize
