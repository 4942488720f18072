#include "mgdd/optimize/least_squares/multi_start.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "mgdd/common/text.hpp"
#include "mgdd/math/latin_hypercube.hpp"

namespace mgdd::optimize {

std::vector<Eigen::VectorXd> spread_starts(const std::vector<Parameter>& parameters, std::size_t n,
                                           std::uint64_t seed) {
  validate(parameters);
  const Eigen::MatrixXd cube = latin_hypercube(n, parameters.size(), seed);
  std::vector<Eigen::VectorXd> points(n, Eigen::VectorXd(cube.cols()));
  for (Eigen::Index j = 0; j < cube.cols(); ++j) {
    const Parameter& p = parameters[static_cast<std::size_t>(j)];
    if (!std::isfinite(p.lower) || !std::isfinite(p.upper)) {
      throw about(p.name, ParameterError(p.name + ": a Latin hypercube needs finite bounds, has [" + text(p.lower) +
                                         ", " + text(p.upper) + "]"));
    }
    const double lower = p.log_scaled ? std::log(p.lower) : p.lower;
    const double upper = p.log_scaled ? std::log(p.upper) : p.upper;
    for (std::size_t i = 0; i < n; ++i) {
      const double z = lower + cube(static_cast<Eigen::Index>(i), j) * (upper - lower);
      points[i][j] = std::clamp(p.log_scaled ? std::exp(z) : z, p.lower, p.upper);
    }
  }
  return points;
}

MultiStartFit rank(std::vector<FitReport> reports) {
  constexpr double reached_factor = 1.005;
  MultiStartFit fit{std::move(reports), 0, 0};
  for (std::size_t i = 1; i < fit.reports.size(); ++i) {
    const double best = fit.reports[fit.best].cost;
    if (fit.reports[i].cost < best || !std::isfinite(best)) fit.best = i;
  }
  for (const FitReport& report : fit.reports)
    fit.n_reached += report.rmse <= reached_factor * fit.reports[fit.best].rmse ? 1U : 0U;
  return fit;
}

}  // namespace mgdd::optimize
