#include "mgdd/guide/curve.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"

namespace mgdd::guide {
namespace {

bool usable(std::span<const double> inputs, std::span<const double> values) noexcept {
  if (inputs.size() < Curve::fewest_points || inputs.size() != values.size()) return false;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (!optimize::is_reading(inputs[i]) || !optimize::is_reading(values[i])) return false;
    if (i > 0 && !(inputs[i] > inputs[i - 1])) return false;
  }
  return true;
}

void require_points(std::span<const double> inputs, std::span<const double> values) {
  if (inputs.size() != values.size()) {
    throw about("values", ShapeError("values has " + std::to_string(values.size()) + " entries: must have " +
                                     std::to_string(inputs.size()) + ", one per input"));
  }
  if (inputs.size() < Curve::fewest_points) {
    throw about("inputs", ShapeError("inputs has " + std::to_string(inputs.size()) + " entries: a curve needs " +
                                     std::to_string(Curve::fewest_points) + " or more"));
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const std::string at = "[" + std::to_string(i) + "]";
    if (!optimize::is_reading(inputs[i])) throw ParameterError("inputs" + at, inputs[i], "must be finite");
    if (!optimize::is_reading(values[i])) throw ParameterError("values" + at, values[i], "must be finite");
    if (i > 0 && !(inputs[i] > inputs[i - 1])) {
      throw ParameterError("inputs" + at, inputs[i], "must be above the one before, " + text(inputs[i - 1]));
    }
  }
}

// Slope at point i of the parabola through it and its neighbours.
double slope_at(std::span<const double> x, std::span<const double> y, std::size_t i) noexcept {
  const std::size_t m = std::clamp<std::size_t>(i, 1, x.size() - 2);
  const double before = (y[m] - y[m - 1]) / (x[m] - x[m - 1]);
  const double after = (y[m + 1] - y[m]) / (x[m + 1] - x[m]);
  const double bend = (after - before) / (x[m + 1] - x[m - 1]);
  return before + bend * (2.0 * x[i] - x[m - 1] - x[m]);
}

}  // namespace

Curve::Curve(std::span<const double> inputs, std::span<const double> values) {
  require_points(inputs, values);
  put(inputs, values);
}

Curve Curve::parabola(double curvature, double best, double reach) {
  require_in(above(-optimize::largest_reading, optimize::largest_reading), "best", best);
  require_positive("reach", reach);
  if (!(curvature < 0.0 && optimize::is_reading(curvature))) {
    throw ParameterError("curvature", curvature, "must be < 0, as at a maximum, and finite");
  }
  Curve out;
  out.first_ = best - reach;
  out.per_step_ = static_cast<double>(nodes - 1) / (2.0 * reach);
  for (std::size_t i = 0; i < nodes; ++i) {
    const double away = reach * (2.0 * static_cast<double>(i) / static_cast<double>(nodes - 1) - 1.0);
    out.values_[i] = 0.5 * curvature * away * away;
  }
  out.find_best();
  return out;
}

bool Curve::put(std::span<const double> inputs, std::span<const double> values) noexcept {
  if (!usable(inputs, values)) return false;
  const double width = inputs.back() - inputs.front();
  first_ = inputs.front();
  per_step_ = static_cast<double>(nodes - 1) / width;
  std::size_t k = 0;
  double left = slope_at(inputs, values, 0), right = slope_at(inputs, values, 1);
  for (std::size_t i = 0; i < nodes; ++i) {
    const double x = first_ + width * (static_cast<double>(i) / static_cast<double>(nodes - 1));
    while (k + 2 < inputs.size() && x > inputs[k + 1]) {
      ++k;
      left = right;
      right = slope_at(inputs, values, k + 1);
    }
    // Cubic Hermite between the points k and k + 1.
    const double h = inputs[k + 1] - inputs[k], t = std::clamp((x - inputs[k]) / h, 0.0, 1.0);
    const double rest = 1.0 - t;
    values_[i] = (1.0 + 2.0 * t) * rest * rest * values[k] + t * t * (3.0 - 2.0 * t) * values[k + 1] +
                 h * t * rest * (rest * left - t * right);
  }
  find_best();
  return true;
}

void Curve::find_best() noexcept {
  const auto highest = static_cast<std::size_t>(std::max_element(values_.begin(), values_.end()) - values_.begin());
  inside_ = highest > 0 && highest + 1 < nodes;
  double shift = 0.0;
  if (inside_) {
    const double rise = 0.5 * (values_[highest + 1] - values_[highest - 1]);
    const double bend = values_[highest + 1] - 2.0 * values_[highest] + values_[highest - 1];
    if (bend < 0.0) shift = -rise / bend;
  }
  best_ = first_ + (static_cast<double>(highest) + shift) / per_step_;
  top_ = (*this)(best_);
}

double Curve::rises_again(double reach) const noexcept {
  const auto at = [&](double input) {
    return static_cast<std::ptrdiff_t>(std::clamp((input - first_) * per_step_, 0.0, static_cast<double>(nodes - 1)));
  };
  const auto highest = std::max_element(values_.begin(), values_.end());
  double lowest = *highest, again = 0.0;
  const auto look = [&](const auto& from, const auto& to) {
    double low = *highest;
    for (auto value = from; value != to; ++value) {
      low = std::min(low, *value);
      again = std::max(again, *value - low);
    }
    lowest = std::min(lowest, low);
  };
  look(highest, values_.begin() + at(best_ + reach));
  look(std::make_reverse_iterator(highest), std::make_reverse_iterator(values_.begin() + at(best_ - reach)));
  return again > 0.0 ? again / (*highest - lowest) : 0.0;
}

}  // namespace mgdd::guide
