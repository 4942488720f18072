#include "mgdd/engine/emissions.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::engine {
namespace {

constexpr std::size_t fewest_points = 5;

void require_positive_column(std::string_view name, std::span<const double> column) {
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (column[i] > 0.0 && std::isfinite(column[i])) continue;
    throw DataError(std::string(name) + "[" + std::to_string(i) + "]", column[i],
                    "must be > 0 and finite, leave such points out");
  }
}

}  // namespace

void validate(const NoxProxy& p) {
  require_fields(fields_of(p), p);
}

void validate(const NoxModel& m) {
  validate(m.proxy);
  require_fields(fields_of(m), m);
}

void validate(const SoftSensor& s) {
  validate(s.model);
  require_fields(fields_of(s), s);
}

NoxFit fit_nox_proxy(std::span<const double> t_max_k, std::span<const double> nox_ppm, NoxMap map,
                     double reference_temperature_k) {
  const std::size_t n = t_max_k.size();
  if (nox_ppm.size() != n) {
    throw about("nox_ppm", ShapeError("nox_ppm has " + std::to_string(nox_ppm.size()) + " entries: t_max_k has " +
                                      std::to_string(n)));
  }
  require_positive("reference_temperature_k", reference_temperature_k, "K");
  if (n < fewest_points) {
    throw about("t_max_k", DataError("t_max_k has " + std::to_string(n) + " points: a fit needs at least " +
                                     std::to_string(fewest_points)));
  }
  require_positive_column("t_max_k", t_max_k);
  require_positive_column("nox_ppm", nox_ppm);
  const auto [coldest, hottest] = std::minmax_element(t_max_k.begin(), t_max_k.end());
  if (!(*hottest - *coldest > 1e-6 * *hottest)) {
    throw about("t_max_k",
                DataError("t_max_k is " + text(*coldest) + " at every point: a slope needs temperatures that differ"));
  }

  // ln NOx = a + b x, with x = (T - T0)/T0^2 or 1/T0 - 1/T: the slope is the activation temperature in both.
  const double t0 = reference_temperature_k;
  std::vector<double> x(n), y(n);
  double x_mean = 0.0, y_mean = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = map == NoxMap::arrhenius ? 1.0 / t0 - 1.0 / t_max_k[i] : (t_max_k[i] - t0) / (t0 * t0);
    y[i] = std::log(nox_ppm[i]);
    x_mean += x[i] / static_cast<double>(n);
    y_mean += y[i] / static_cast<double>(n);
  }
  double xx = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    xx += (x[i] - x_mean) * (x[i] - x_mean);
    xy += (x[i] - x_mean) * (y[i] - y_mean);
  }
  const double slope = xy / xx;
  if (!(slope > 0.0)) {
    throw about("nox_ppm", DataError("nox_ppm does not rise with t_max_k (activation temperature " + text(slope) +
                                     " K): check the order of the points and that oxygen, fuel and boost stood still"));
  }
  double squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double residual = y[i] - y_mean - slope * (x[i] - x_mean);
    squares += residual * residual;
  }
  NoxFit fit;
  fit.map = map;
  fit.points = n;
  fit.proxy = {t0, std::exp(y_mean - slope * x_mean), slope};
  fit.residual_ln = std::sqrt(squares / static_cast<double>(n - 2));
  fit.activation_temperature_stderr_k = fit.residual_ln / std::sqrt(xx);
  fit.reference_nox_stderr_ppm =
      fit.proxy.reference_nox_ppm * fit.residual_ln * std::sqrt(1.0 / static_cast<double>(n) + x_mean * x_mean / xx);
  return fit;
}

}  // namespace mgdd::engine
