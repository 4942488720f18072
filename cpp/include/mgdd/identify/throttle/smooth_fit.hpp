// Fit of the smooth throttle's ten parameters to a duty and angle record, from one or many starts. Staged: a short
// beginning of the record first, then all of it, so that far starts are pulled in cheaply and a free run cannot drift
// away. Searches run side by side in SIMD lanes; each sees only condensed normal equations (n + 1 rows with the same
// J'J, J'r and r'r). SI and rad, residual in deg. Desk-time code.
#pragma once

#include <array>
#include <cstddef>
#include <stop_token>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "mgdd/identify/throttle/smooth_kernel.hpp"
#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/parameter.hpp"

namespace mgdd::identify {

/// Rows with the sums of a long residual: J~'J~ = J'J, J~'r~ = J'r, r~'r~ = r'r. Directions whose share of J'J is below
/// rounding become exact null rows. `residual` gets n + 1 rows, `jacobian` n + 1 by n.
void condense(const Eigen::MatrixXd& jacobian_squared, const Eigen::VectorXd& gradient, double sum_squares,
              Eigen::VectorXd& residual, Eigen::MatrixXd& jacobian);

/// One stage: the first `fraction` of the record, with these parameters free (indices of
/// SmoothPlant::parameter_names), to a relative tolerance of the cost.
struct SmoothThrottleStage {
  double fraction = 1.0;
  std::vector<std::size_t> free;
  double cost_tolerance = 1e-9;
  int max_iterations = 60;
  double initial_damping = 1e-3;
};

struct SmoothThrottleFitOptions {
  std::array<double, 10> lower{};  ///< bounds; all parameters are positive and searched as logarithms
  std::array<double, 10> upper{};
  std::vector<SmoothThrottleStage> stages;
  bool lanes = true;                 ///< several starts side by side; false: one after the other
  double undetermined_error = 0.25;  ///< a width with a larger relative standard error is named
  std::stop_token stop{};            ///< a request ends all searches; their reports say so
};

/// Bounds 0.1 and 10 times the centre, and four stages: a twentieth of the record without and with the widths, a
/// quarter, then all of it with all ten. For records of about 20 s with steps every 0.1 s.
SmoothThrottleFitOptions smooth_throttle_options(const std::array<double, 10>& centre);

struct SmoothThrottleFit {
  std::vector<optimize::FitReport> reports;        ///< one per start, last stage; without the residual
  std::vector<std::array<double, 10>> parameters;  ///< all ten, per start
  std::size_t best = 0;
  std::size_t n_reached = 0;  ///< starts whose rmse is within 0.5 % of the best
  std::size_t n_sweeps = 0;   ///< passes over the whole record, lanes counted singly
};

/// Throws ParameterError or ShapeError before any work.
SmoothThrottleFit fit_smooth_throttle(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record,
                                      const std::vector<std::array<double, 10>>& starts,
                                      const SmoothThrottleFitOptions& options);

}  // namespace mgdd::identify
