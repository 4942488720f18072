#include "mgdd/engine/pressure/burn_window.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "mgdd/engine/pressure/heat.hpp"
#include "mgdd/engine/pressure/pegging.hpp"
#include "mgdd/math/line_fit.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

constexpr double latest_compression_cad = -50.0;  // no burn before it, unless injection or spark are stated earlier
constexpr double scatter_factor = 4.0;
constexpr double expansion_fit_cad = 45.0;  // last part of the trace, taken as free of burning

struct Range {
  double from, to;
  bool holds(double angle) const { return angle >= from - 1e-9 && angle <= to + 1e-9; }
};

// Heat release rate [bar L/CAD] at gamma: slope of the least-squares line through the cumulative heat around each
// sample, over the samples within `burn_rate_half_cad` or the two neighbours. Zero at both ends.
Column heat_rate(const Column& angle, const Column& pressure, const Column& volume, double gamma) {
  const std::size_t n = angle.size();
  Column heat(n, 0.0), rate(n, 0.0);
  for (std::size_t k = 1; k < n; ++k)
    heat[k] = heat[k - 1] + net_heat(gamma, pressure[k - 1], volume[k - 1], pressure[k], volume[k]);
  LineFit line;  // of the samples low to high - 1, which move along
  std::size_t low = 0, high = 0;
  for (std::size_t k = 1; k + 1 < n; ++k) {
    for (; high < n && (high <= k + 1 || angle[high] <= angle[k] + burn_rate_half_cad + 1e-9); ++high)
      line.add(angle[high], heat[high]);
    for (; low + 1 < k && angle[low] < angle[k] - burn_rate_half_cad - 1e-9; ++low)
      line.add(angle[low], heat[low], -1.0);
    rate[k] = line.slope();
  }
  return rate;
}

// Scatter of the rate where nothing burns. It goes with the volume: noise of the pressure times V is noise of the heat.
double scatter_per_volume(const Column& angle, const Column& rate, const Column& volume, Range range) {
  double squares = 0.0, n = 0.0;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (range.holds(angle[k])) squares += std::pow(rate[k] / volume[k], 2), n += 1.0;
  }
  return n > 0.0 ? std::sqrt(squares / n) : undefined<double>();
}

}  // namespace

BurnWindow find_burn(const Column& angle, const Column& pressure, const Column& volume,
                     std::optional<double> earliest_cad) {
  const double first = angle.front() + burn_rate_half_cad, last = angle.back() - burn_rate_half_cad;
  const double before = std::min(latest_compression_cad, earliest_cad.value_or(0.0) - 5.0);
  Range compression{std::max(-100.0, first), before};
  if (compression.to - compression.from < 20.0) compression.from = first;
  const double n_compression = polytropic_exponent(angle, pressure, volume, compression.from, compression.to);
  const Range expansion{std::max(60.0, angle.back() - expansion_fit_cad), last};
  const double n_expansion = polytropic_exponent(angle, pressure, volume, expansion.from, expansion.to);
  if (!(n_compression > 1.0 && n_expansion > 1.0)) return {};

  const Column early = heat_rate(angle, pressure, volume, n_compression);
  const double early_scatter = scatter_factor * scatter_per_volume(angle, early, volume, compression);
  const double search_from = earliest_cad.value_or(before);
  const std::size_t n = angle.size();
  std::size_t peak = n;
  for (std::size_t k = 0; k < n; ++k) {
    if (angle[k] >= before && angle[k] <= expansion.to - 20.0 && (peak == n || early[k] > early[peak])) peak = k;
  }
  if (peak == n || !(early[peak] > early_scatter * volume[peak])) return {};
  const double level = burn_threshold * early[peak];

  // First stretch of at least `burn_rate_half_cad` above the threshold, seen from compression.
  const auto start_from = [&](double from) {
    std::size_t run = n;
    for (std::size_t k = 0; k <= peak; ++k) {
      const bool on = angle[k] >= from && early[k] > std::max(level, early_scatter * volume[k]);
      if (!on) run = n;
      if (on && run == n) run = k;
      if (run != n && (angle[k] - angle[run] >= burn_rate_half_cad - 1e-9 || k == peak)) return angle[run];
    }
    return std::max(from, angle[peak]);
  };
  BurnWindow burn{true, start_from(search_from), angle[peak], start_from(before)};
  // The last such stretch, seen from expansion.
  std::size_t run = n;
  const Column late = heat_rate(angle, pressure, volume, n_expansion);
  const Range quiet{std::max(expansion.from, angle.back() - 30.0), last};
  const double late_scatter = scatter_factor * scatter_per_volume(angle, late, volume, quiet);
  for (std::size_t k = n; k-- > peak;) {
    const bool on = late[k] > std::max(level, late_scatter * volume[k]);
    if (!on) run = n;
    if (on && run == n) run = k;
    if (run != n && (angle[run] - angle[k] >= burn_rate_half_cad - 1e-9 || k == peak)) {
      burn.end_cad = angle[run];
      break;
    }
  }
  return burn;
}

Symmetry compare_strokes(const Column& angle, const Column& pressure, const Geometry<double>& geometry) {
  constexpr double nearest_cad = 60.0, farthest_cad = 120.0, least_span_cad = 20.0, step_cad = 1.0;
  constexpr double exponent_between = 1.35;  // of both strokes; 0.05 more is 4 % of the offset
  const double reach = std::min({farthest_cad, -angle.front(), angle.back()});
  if (reach < nearest_cad + least_span_cad) return {};
  const auto log_pressure = [&](double at) {
    const auto above = std::lower_bound(angle.begin(), angle.end(), at) - angle.begin();
    const auto k = std::clamp<std::size_t>(static_cast<std::size_t>(above), 1, angle.size() - 1);
    const double share = (at - angle[k - 1]) / (angle[k] - angle[k - 1]);
    return (1.0 - share) * std::log(pressure[k - 1]) + share * std::log(pressure[k]);
  };
  LineFit line;
  for (double d = nearest_cad; d <= reach + 1e-9; d += step_cad) {
    const double at = std::min(d, reach);
    line.add(geometry.volume_slope_m3_per_cad(at) / geometry.volume_m3(at), log_pressure(at) - log_pressure(-at));
  }
  return {line.intercept(), line.slope() / (2.0 * exponent_between)};
}

}  // namespace mgdd::engine
