#include "mgdd/engine/pressure/smoothing.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/pressure/angles.hpp"

namespace mgdd::engine {
namespace {

// Value at the centre of the least-squares parabola through the samples within `reach` of it, by Cramer's rule.
double parabola_at(const std::vector<double>& x, const std::vector<double>& y, std::size_t centre, std::size_t reach) {
  double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0, s4 = 0.0, t0 = 0.0, t1 = 0.0, t2 = 0.0;
  for (std::size_t i = centre - reach; i <= centre + reach; ++i) {
    const double u = x[i] - x[centre], u2 = u * u;
    s0 += 1.0, s1 += u, s2 += u2, s3 += u2 * u, s4 += u2 * u2;
    t0 += y[i], t1 += u * y[i], t2 += u2 * y[i];
  }
  const double c0 = s2 * s4 - s3 * s3, c1 = s2 * s3 - s1 * s4, c2 = s1 * s3 - s2 * s2;
  return (c0 * t0 + c1 * t1 + c2 * t2) / (s0 * c0 + s1 * c1 + s2 * c2);
}

}  // namespace

Smoother::Smoother(const std::vector<double>& angle, double speed_rpm, const TraceOptions& o) : angle_(angle) {
  const double step = median_step(angle);
  const auto reach = static_cast<std::size_t>(0.5 * o.smoothing_width_cad / step + 1e-6);
  const std::size_t samples = 2 * reach + 1;
  Smoothing kind = o.smoothing;
  if (kind == Smoothing::automatic) {
    kind = samples >= automatic_smoothing_samples ? Smoothing::savitzky_golay : Smoothing::none;
  }
  if (kind == Smoothing::none) return;
  if (kind == Smoothing::low_pass) {
    if (!is_even(angle, 0.01)) {
      throw DataError("smoothing 'low_pass' needs even angles, but the steps of crank_angle_cad differ from " +
                      text(step) + " °CA by more than 1 %: take savitzky_golay or angle_window");
    }
    const double nyquist_hz = 0.5 * units::cad_per_s_per_rpm * speed_rpm / step;
    const double lowest = ZeroPhaseLowPass::least_cutoff * nyquist_hz;
    const double highest = ZeroPhaseLowPass::largest_cutoff * nyquist_hz;
    if (!(o.smoothing_cutoff_hz >= lowest && o.smoothing_cutoff_hz <= highest)) {
      throw ParameterError("smoothing_cutoff_hz", o.smoothing_cutoff_hz,
                           "must be in [" + text(lowest) + ", " + text(highest) + "] Hz for steps of " + text(step) +
                               " °CA at " + text(speed_rpm) + " rpm",
                           "Hz");
    }
    low_pass_.emplace(angle.size(), o.smoothing_cutoff_hz / nyquist_hz);
    name_ = "low_pass at " + text(o.smoothing_cutoff_hz) + " Hz";
    return;
  }
  if (samples < 5) {
    throw ParameterError("smoothing_width_cad", o.smoothing_width_cad,
                         "must hold at least 5 samples of " + text(step) + " °CA: take " + text(4.0 * step) +
                             " or more, or smoothing 'none'",
                         "°CA");
  }
  reach_ = reach;
  mean_ = kind == Smoothing::angle_window;
  if (!mean_ && is_even(angle, 1e-6)) {  // the weights are those of one unit sample after the other
    const std::vector<double> x(angle.begin(), angle.begin() + static_cast<std::ptrdiff_t>(samples));
    std::vector<double> unit(samples, 0.0);
    for (std::size_t i = 0; i < samples; ++i) {
      unit[i] = 1.0;
      weights_.push_back(parabola_at(x, unit, reach, reach));
      unit[i] = 0.0;
    }
  }
  name_ = std::string(name_of(kind)) + " over " + text(o.smoothing_width_cad) + " °CA (" + std::to_string(samples) +
          " samples)";
}

std::vector<double> Smoother::operator()(const std::vector<double>& column) const {
  std::vector<double> out = column;
  if (low_pass_) {
    ZeroPhaseLowPass filter = *low_pass_;
    filter.apply(out);
    return out;
  }
  for (std::size_t k = 0; k < column.size(); ++k) {
    const std::size_t r = std::min({reach_, k, column.size() - 1 - k});
    if (r == 0) continue;
    const auto first = column.begin() + static_cast<std::ptrdiff_t>(k - r);
    if (mean_) {
      const auto n = static_cast<std::ptrdiff_t>(2 * r + 1);
      out[k] = std::accumulate(first, first + n, 0.0) / static_cast<double>(n);
    } else if (r == reach_ && !weights_.empty()) {
      out[k] = std::inner_product(weights_.begin(), weights_.end(), first, 0.0);
    } else {
      out[k] = parabola_at(angle_, column, k, r);
    }
  }
  return out;
}

}  // namespace mgdd::engine
