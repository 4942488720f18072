#include "mgdd/identify/multi_start.hpp"

#include <algorithm>

#include "mgdd/common/random.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::identify {

std::vector<Eigen::VectorXd> latin_hypercube(const std::vector<optimize::Parameter>& parameters, std::size_t n,
                                             std::uint64_t seed) {
  optimize::validate(parameters);
  std::vector<Eigen::VectorXd> points(n, Eigen::VectorXd(static_cast<Eigen::Index>(parameters.size())));
  std::vector<std::size_t> cell(n);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const optimize::Parameter& p = parameters[j];
    if (!std::isfinite(p.lower) || !std::isfinite(p.upper)) {
      throw ParameterError(p.name + ": a Latin hypercube needs finite bounds, has [" + text(p.lower) + ", " +
                           text(p.upper) + "]");
    }
    for (std::size_t i = 0; i < n; ++i)
      cell[i] = i;
    for (std::size_t i = n; i > 1; --i) {  // Fisher and Yates
      const auto other = static_cast<std::size_t>(random::uniform(seed, 2 * j, i) * static_cast<double>(i));
      std::swap(cell[i - 1], cell[other]);
    }
    const double lower = p.log_scaled ? std::log(p.lower) : p.lower;
    const double upper = p.log_scaled ? std::log(p.upper) : p.upper;
    for (std::size_t i = 0; i < n; ++i) {
      const double share =
          (static_cast<double>(cell[i]) + random::uniform(seed, 2 * j + 1, i)) / static_cast<double>(n);
      const double z = lower + share * (upper - lower);
      points[i][static_cast<Eigen::Index>(j)] = std::clamp(p.log_scaled ? std::exp(z) : z, p.lower, p.upper);
    }
  }
  return points;
}

MultiStartFit rank(std::vector<optimize::FitReport> reports) {
  constexpr double reached_factor = 1.005;
  MultiStartFit fit{std::move(reports), 0, 0};
  for (std::size_t i = 1; i < fit.reports.size(); ++i) {
    const double best = fit.reports[fit.best].cost;
    if (fit.reports[i].cost < best || !std::isfinite(best)) fit.best = i;
  }
  for (const optimize::FitReport& report : fit.reports)
    fit.n_reached += report.rmse <= reached_factor * fit.reports[fit.best].rmse ? 1U : 0U;
  return fit;
}

}  // namespace mgdd::identify
