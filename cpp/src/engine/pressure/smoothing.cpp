#include "mgdd/engine/pressure/smoothing.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::engine {
namespace {

double median_step(const std::vector<double>& angle) {
  std::vector<double> steps(angle.size() - 1);
  for (std::size_t k = 0; k + 1 < angle.size(); ++k)
    steps[k] = angle[k + 1] - angle[k];
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

// Weights that give the value at 0 of the least-squares parabola through samples at x: the first row of
// (A^T A)^-1 A^T with A = [1 x x^2], by Cramer's rule (Savitzky and Golay 1964 for even steps).
std::vector<double> parabola_weights(const std::vector<double>& x) {
  double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0, s4 = 0.0;
  for (const double v : x) {
    const double v2 = v * v;
    s0 += 1.0, s1 += v, s2 += v2, s3 += v2 * v, s4 += v2 * v2;
  }
  const double c0 = s2 * s4 - s3 * s3, c1 = s2 * s3 - s1 * s4, c2 = s1 * s3 - s2 * s2;
  const double determinant = s0 * c0 + s1 * c1 + s2 * c2;
  std::vector<double> weight(x.size());
  for (std::size_t i = 0; i < x.size(); ++i)
    weight[i] = (c0 + c1 * x[i] + c2 * x[i] * x[i]) / determinant;
  return weight;
}

}  // namespace

Smoother::Smoother(const std::vector<double>& angle, double speed_rpm, const TraceOptions& o) {
  const double step = median_step(angle);
  const auto reach = static_cast<std::size_t>(0.5 * o.smoothing_width_cad / step + 1e-6);
  const std::size_t samples = 2 * reach + 1;
  Smoothing kind = o.smoothing;
  if (kind == Smoothing::automatic) {
    kind = samples >= automatic_smoothing_samples ? Smoothing::savitzky_golay : Smoothing::none;
  }
  if (kind == Smoothing::none) return;
  if (kind == Smoothing::low_pass) {
    for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
      if (std::abs(angle[k + 1] - angle[k] - step) <= 0.01 * step) continue;
      throw DataError("smoothing 'low_pass' needs even angles, but the step at crank_angle_cad[" + std::to_string(k) +
                      "] = " + text(angle[k]) + " is " + text(angle[k + 1] - angle[k]) + " °CA, elsewhere " +
                      text(step) + ": take savitzky_golay or angle_window");
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
  windows_.reserve(angle.size());
  for (std::size_t k = 0; k < angle.size(); ++k) {
    const std::size_t r = std::min({reach, k, angle.size() - 1 - k});
    std::vector<double> weight(2 * r + 1, 1.0 / static_cast<double>(2 * r + 1));
    if (kind == Smoothing::savitzky_golay && r > 0) {
      for (std::size_t i = 0; i < weight.size(); ++i)
        weight[i] = angle[k - r + i] - angle[k];
      weight = parabola_weights(weight);
    }
    windows_.push_back({k - r, std::move(weight)});
  }
  name_ = std::string(to_string(kind)) + " over " + text(o.smoothing_width_cad) + " °CA (" + std::to_string(samples) +
          " samples)";
}

std::vector<double> Smoother::operator()(const std::vector<double>& column) const {
  std::vector<double> out = column;
  if (low_pass_) {
    ZeroPhaseLowPass filter = *low_pass_;
    filter.apply(out);
    return out;
  }
  for (std::size_t k = 0; k < windows_.size(); ++k) {
    const Window& w = windows_[k];
    out[k] = std::inner_product(w.weight.begin(), w.weight.end(), column.begin() + static_cast<std::ptrdiff_t>(w.first),
                                0.0);
  }
  return out;
}

}  // namespace mgdd::engine
