#include "mgdd/engine/pressure/rise_rate.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "mgdd/math/cubic_weights.hpp"
#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/sliding_sums.hpp"

namespace mgdd::engine {
namespace {

constexpr double coarsest_cad = 0.25;

// A place on a trace, and the samples that its pressure is the weighted sum of.
struct Place {
  double at_cad;
  CubicWeights value;
};

std::vector<Place> places(std::span<const double> angle) {
  std::vector<Place> out;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    out.push_back({angle[k], {.first = k, .count = 1, .value = {1.0}}});
    if (k + 1 == angle.size()) break;
    const double step = angle[k + 1] - angle[k];
    const int parts = std::max(1, static_cast<int>(std::ceil(step / coarsest_cad - 1e-6)));
    for (int i = 1; i < parts; ++i)
      out.push_back({angle[k] + step * i / parts, cubic_weights(angle, k, angle[k] + step * i / parts)});
  }
  return out;
}

// Weights of the slope of the line through the places low to high, over the samples from the returned one on. Half
// weight at both ends: the sums are trapezoids of the integrals.
std::size_t slope_weights(const std::vector<Place>& at, std::size_t low, std::size_t high, std::vector<double>& out) {
  double n = 0.0, mean = 0.0, squares = 0.0;
  const auto share = [&](std::size_t i) { return i == low || i == high ? 0.5 : 1.0; };
  for (std::size_t i = low; i <= high; ++i)
    n += share(i), mean += share(i) * at[i].at_cad;
  mean /= n;
  std::size_t first = at[low].value.first, end = 0;
  for (std::size_t i = low; i <= high; ++i) {
    const double off = at[i].at_cad - mean;
    squares += share(i) * off * off;
    first = std::min(first, at[i].value.first), end = std::max(end, at[i].value.first + at[i].value.count);
  }
  out.assign(end - first, 0.0);
  for (std::size_t i = low; i <= high; ++i) {
    const CubicWeights& value = at[i].value;
    for (std::size_t j = 0; j < value.count; ++j)
      out[value.first + j - first] += share(i) * (at[i].at_cad - mean) / squares * value.value[j];
  }
  return first;
}

}  // namespace

RiseRate::RiseRate(std::span<const double> angle) {
  const std::vector<Place> at = places(angle);
  std::vector<std::vector<double>> rows;
  std::size_t low = 0, high = 0;
  for (std::size_t k = 0; k < at.size(); ++k) {
    const double from = at[k].at_cad - 0.5 * rise_rate_width_cad - 1e-9, to = from + rise_rate_width_cad + 2e-9;
    if (from < at.front().at_cad - 1e-6 || to > at.back().at_cad + 1e-6) continue;  // only whole lines
    for (; high + 1 < at.size() && at[high + 1].at_cad <= to; ++high) {
    }
    for (; at[low].at_cad < from; ++low) {
    }
    rows.emplace_back();
    lines_.push_back({slope_weights(at, low, high, rows.back()), at[k].at_cad});
    taps_ = std::max(taps_, rows.back().size());
  }
  alike_ = !rows.empty();
  for (std::size_t k = 0; k < rows.size() && alike_; ++k) {
    alike_ = lines_[k].first == lines_[0].first + k && rows[k].size() == taps_;
    for (std::size_t j = 0; j < taps_ && alike_; ++j)
      alike_ = std::abs(rows[k][j] - rows[0][j]) < 1e-6 * rows[0].back();
  }
  if (alike_) rows.resize(1);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (!alike_) {  // a row as long as all others must end within the trace
      const std::size_t back = lines_[k].first - std::min(lines_[k].first, angle.size() - taps_);
      rows[k].insert(rows[k].begin(), back, 0.0);
      lines_[k].first -= back;
    }
    rows[k].resize(taps_, 0.0);
    weights_.insert(weights_.end(), rows[k].begin(), rows[k].end());
  }
}

SteepestRise RiseRate::operator()(const double* pressure) const noexcept {
  SteepestRise out;
  dispatch([&]() MGDD_INLINE_LAMBDA {
    const std::size_t n = lines_.size();
    const std::span<const double> weights = weights_;
    double steepest = out.bar_per_cad;
    std::size_t at = n;
    const auto take = [&](std::size_t line, double slope) MGDD_INLINE_LAMBDA {
      if (slope > steepest) steepest = slope, at = line;
    };
    constexpr std::size_t block = 128;
    std::array<double, block> slopes{};
    for (std::size_t k = 0; alike_ && k < n; k += block) {
      const std::span<double> some = std::span(slopes).first(std::min(block, n - k));
      sliding_sums(weights, pressure + lines_[0].first + k, some);
      for (std::size_t i = 0; i < some.size(); ++i)
        take(k + i, some[i]);
    }
    for (std::size_t k = 0; !alike_ && k < n; ++k) {
      double slope = 0.0;
      for (std::size_t j = 0; j < taps_; ++j)
        slope += weights[k * taps_ + j] * pressure[lines_[k].first + j];
      take(k, slope);
    }
    if (at < n) out = {steepest, lines_[at].at_cad};
  });
  return out;
}

}  // namespace mgdd::engine
