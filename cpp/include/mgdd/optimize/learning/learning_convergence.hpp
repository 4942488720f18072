// What a learning law will do, told before the first trial: whether it converges, whether every trial is better than
// the one before, and which error remains. Bounds, rate and guard are not part of the linear theory.
// Errors in the unit of the caller, frequencies as fractions of Nyquist. Source: Bristow, Tharayil and Alleyne (2006).
// Not real-time safe: builds dense matrices of n = samples - m rows.
#pragma once

#include <limits>
#include <string>

#include <Eigen/Core>

#include "mgdd/optimize/learning/learning_law.hpp"

namespace mgdd::optimize {

/// Findings for y = G u + d, with G the lower-triangular Toeplitz matrix of h_m, h_{m+1}, ...
struct ConvergenceReport {
  double spectral_radius = std::numeric_limits<double>::quiet_NaN();  ///< rho(Q (I - L G))
  bool radius_is_exact =
      false;  ///< read from a diagonal or closed form; else computed, doubtful far from a normal matrix
  double sigma_max = std::numeric_limits<double>::quiet_NaN();         ///< of e_j - e_inf -> e_{j+1} - e_inf
  double frequency_gain = std::numeric_limits<double>::quiet_NaN();    ///< max |Q (1 - z^m L G)| on the unit circle
  double worst_frequency = std::numeric_limits<double>::quiet_NaN();   ///< where it is reached, in [0, 1]
  Eigen::MatrixXd limit_error_map;                                     ///< r - d -> e_inf; empty unless asymptotic
  double limit_error_gain = std::numeric_limits<double>::quiet_NaN();  ///< its largest singular value
  bool asymptotic = false;                                             ///< spectral_radius < 1: the trials converge
  bool monotone = false;  ///< sigma_max < 1: the distance to the limit error shrinks in every trial
  std::string sentence;   ///< human-readable summary
};

/// Throws ParameterError without an impulse response, ConvergenceError where the eigenvalues cannot be found.
[[nodiscard]] ConvergenceReport convergence(const LearningUpdate& law);

}  // namespace mgdd::optimize
