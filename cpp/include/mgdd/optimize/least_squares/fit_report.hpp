// Result of a fit: estimates, their uncertainty, parameters that the data do not identify, and the course of the
// search. Values stand in the units of the caller's parameters. Not real-time safe: reports allocate, the search does
// not.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace mgdd::optimize {

/// Why the search ended. A report that never saw a model says `not_run`.
enum class FitStatus {
  not_run,             ///< no evaluation yet; every number of the report is NaN
  cost_converged,      ///< the last step and its prediction changed the cost by less than `cost_tolerance`
  step_converged,      ///< the last step was below `step_tolerance` of the parameters
  gradient_converged,  ///< the residual is orthogonal to every free Jacobian column within
                       ///< `gradient_tolerance`
  iteration_limit,     ///< stopped before a tolerance was met
  evaluation_failed,   ///< the model could not be evaluated at the start
  stalled,             ///< no step lowers the cost although the gradient is not zero
  interrupted,         ///< stopped by request; what was found until then is in the report
};

/// What the status means, in one sentence.
[[nodiscard]] std::string_view explain(FitStatus status) noexcept;

[[nodiscard]] bool is_converged(FitStatus status) noexcept;

/// One trial step. The first entry of a history is the start, with a step of length zero.
struct FitStep {
  double cost;       ///< cost after the decision on this step
  double damping;    ///< damping the step was computed with, relative to unit Jacobian columns [-]
  double step_norm;  ///< length of the step in scaled parameters, in the unit of the residual
  bool accepted;
};

/// Result of a least-squares fit. Parameters at a bound carry NaN uncertainty: they were held, not estimated.
struct FitReport {
  std::vector<std::string> names;
  Eigen::VectorXd values;
  Eigen::VectorXd standard_error;  ///< infinite for a parameter that takes part in a null direction
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  Eigen::VectorXi bounds_active;  ///< -1 at the lower bound, +1 at the upper, 0 free
  Eigen::MatrixXd covariance;     ///< s^2 (J^T J)^-1 over the free parameters, s^2 = 2 cost / (n_residuals - rank);
                                  ///< of a correlated residual by `block_sandwich`
  Eigen::MatrixXd correlation;    ///< for a null direction its limit: +-1 between parameters that trade exactly
  std::vector<std::string> unidentifiable;  ///< names that the data do not determine, in the order of `names`
  std::vector<std::string> findings;        ///< one sentence per reason behind `unidentifiable`
  Eigen::MatrixXd null_directions;          ///< columns: parameter changes, largest 1, that leave the residual as it is
  Eigen::VectorXd residual;                 ///< at `values`
  /// Blocks that the standard errors count as independent; NaN where they count every residual.
  double residual_blocks = std::numeric_limits<double>::quiet_NaN();
  double rmse = std::numeric_limits<double>::quiet_NaN();  ///< sqrt(mean r^2)
  double cost = std::numeric_limits<double>::quiet_NaN();  ///< sum r^2 / 2
  int nfev = 0;                                            ///< residual evaluations
  int njev = 0;                                            ///< Jacobian evaluations
  int iterations = 0;                                      ///< trial steps
  Eigen::Index n_residuals = 0;
  std::vector<FitStep> history;
  FitStatus status = FitStatus::not_run;

  [[nodiscard]] bool success() const noexcept { return is_converged(status); }

  /// One line: status, iterations, root mean square error, unidentifiable names.
  [[nodiscard]] std::string brief() const;
};

/// Limits above which a parameter counts as not determined by the data.
struct IdentifiabilityLimits {
  double correlation = 0.98;      ///< |correlation| beyond this names both parameters [-]
  double rank_tolerance = 1e-10;  ///< singular value, relative to the largest, that counts as zero [-]
};

/// Fills covariance, correlation, standard errors and the unidentifiable names of a report that already holds
/// names, values, bounds, `bounds_active`, cost and n_residuals. The Jacobian in the caller's units is Q
/// `triangle` diag(`column_scale`) with orthonormal Q, so a Jacobian itself with a scale of ones is accepted
/// too. Source: Bates and Watts (1988), section 2.2; truncation by singular values as in Björck (1996),
/// section 2.7.
void describe_uncertainty(FitReport& report, const Eigen::MatrixXd& triangle, const Eigen::VectorXd& column_scale,
                          const IdentifiabilityLimits& limits);

}  // namespace mgdd::optimize
