// Output-error fit of a pseudo-Wiener model to throttle logs: free run from the first measured angle, exact forward
// sensitivities, Levenberg-Marquardt from several starts, the delay by a grid. Units: deg, s, duty. Offline code;
// the residual itself allocates nothing.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/parameter.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::identify {

/// A log at the sample time of the model's frame.
struct ThrottleRecord {
  std::vector<double> duty;
  std::vector<double> angle_deg;
};

/// One unknown of a fit: its name, bounds, and the numbers of the model (indices into `fields`) that take its value.
struct PseudoWienerUnknown {
  optimize::Parameter parameter;
  std::vector<std::size_t> numbers;
};

/// Which parameter sets of PW-R a log determines; the other kinds have one set.
enum class Sides {
  shared,  ///< one set of values for both sides
  above,
  below,
  both,  ///< a set each
};

struct PseudoWienerFitOptions {
  int starts = 12;         ///< per delay and start rule
  std::uint64_t seed = 1;  ///< of the Latin hypercube
  Sides sides = Sides::shared;
  std::vector<std::string> free;  ///< names without the side; empty: the kind's own
  std::vector<double> delays{0};  ///< samples, whole or not, tried one by one
  bool try_lag_starts = true;     ///< PW-W, PW-P: both rules for the start of the lags; false keeps the model's own
  bool only_given_start = false;  ///< one search, from the numbers of the model itself
  double same_cost = 1e-3;        ///< relative difference of cost that counts as the same optimum
  optimize::LeastSquaresOptions search{.max_iterations = 150, .cost_tolerance = 1e-9, .step_tolerance = 1e-8};

  void validate() const;
};

struct PseudoWienerFit {
  throttle::PseudoWiener model;
  optimize::FitReport report;
  std::vector<double> rmse_deg;  ///< of every search, best first; infinite where a search failed
  int n_best = 0;                ///< searches that ended at the best cost
};

/// ShapeError, DataError or ParameterError for what cannot be fitted. `base` carries the kind, the frame, and every
/// number that is not free.
PseudoWienerFit fit_pseudo_wiener(const std::vector<ThrottleRecord>& records, const throttle::PseudoWiener& base,
                                  const PseudoWienerFitOptions& options);

}  // namespace mgdd::identify
