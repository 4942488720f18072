// Fits from many starts. They come from a Latin hypercube of counter-based random numbers, so that the same seed gives
// the same starts on every machine; results do not depend on the number of threads. Offline.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "mgdd/common/error.hpp"
#include "mgdd/common/parallel.hpp"
#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/parameter.hpp"

namespace mgdd::optimize {

/// `n` points between the finite bounds of the parameters, one per cell of every axis; log-scaled ones evenly in the
/// logarithm. ParameterError for a bound that is not finite.
std::vector<Eigen::VectorXd> spread_starts(const std::vector<Parameter>& parameters, std::size_t n, std::uint64_t seed);

struct MultiStartFit {
  std::vector<FitReport> reports;  ///< one per start, in order
  std::size_t best = 0;            ///< lowest cost
  std::size_t n_reached = 0;       ///< reports whose rmse is within 0.5 % of the best
};

/// Ranks finished reports.
MultiStartFit rank(std::vector<FitReport> reports);

/// `fit(start)` for every start, on `n_threads` threads (0: all cores): it must not share state then. The exception of
/// the first start that fails comes back.
template <class Fit>
MultiStartFit multi_start(const std::vector<Eigen::VectorXd>& starts, Fit&& fit, std::size_t n_threads = 1) {
  if (starts.empty()) throw about("starts", ShapeError("starts: must be at least one"));
  std::vector<FitReport> reports(starts.size());
  parallel_for(starts.size(), n_threads,
               [&](std::size_t i, std::size_t, StopRequest&) { reports[i] = fit(starts[i]); });
  return rank(std::move(reports));
}

}  // namespace mgdd::optimize
