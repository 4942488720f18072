#include "mgdd/optimize/belief/surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mgdd/common/error.hpp"

namespace mgdd::optimize {

Surface::Surface(std::vector<std::vector<double>> axes, std::vector<double> values)
    : axes_(std::move(axes)), values_(std::move(values)) {
  if (axes_.empty() || axes_.size() > most_inputs) {
    throw about("axes", ShapeError("axes has " + std::to_string(axes_.size()) + " entries: a surface has one to five"));
  }
  std::size_t nodes = 1;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    require_axis("axes[" + std::to_string(i) + "]", axes_[i]);
    nodes *= axes_[i].size();
  }
  if (values_.size() != nodes) {
    throw about("values", ShapeError("values has " + std::to_string(values_.size()) + " entries: the axes have " +
                                     std::to_string(nodes) + " nodes"));
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    if (!std::isfinite(values_[i])) {
      throw ParameterError("values[" + std::to_string(i) + "]", values_[i], "must be finite: fill the gap first");
    }
  }
}

double Surface::read(const Inputs& at, Inputs& slopes) const noexcept {
  const std::size_t n = axes_.size();
  std::array<CubicWeights, most_inputs> on;
  std::array<std::size_t, most_inputs> stride{}, step{};
  std::size_t nodes = 1;
  for (std::size_t i = n; i-- > 0;) {
    stride[i] = nodes;
    nodes *= axes_[i].size();
    const auto own = static_cast<Eigen::Index>(i);
    const double held = std::clamp(at[own], axes_[i].front(), axes_[i].back());
    on[i] = cubic_weights(axes_[i], interval_of(axes_[i], held), held);
    if (held != at[own]) on[i].slope.fill(0.0);
  }
  // The nodes around, then without their last axis, and so on: what is left of the value and of every slope.
  constexpr std::size_t around = 1024;
  static_assert(most_inputs == 5);  // of four nodes each
  std::array<double, around> value;
  std::array<std::array<double, around / 4>, most_inputs> slope;
  std::size_t left = 0;
  for (bool more = true; more; ++left) {
    std::size_t node = 0;
    for (std::size_t i = 0; i < n; ++i)
      node += (on[i].first + step[i]) * stride[i];
    value[left] = values_[node];
    std::size_t axis = n;
    while (axis > 0 && ++step[axis - 1] == on[axis - 1].count)
      step[--axis] = 0;
    more = axis > 0;
  }
  for (std::size_t i = n; i-- > 0;) {
    const CubicWeights& own = on[i];
    left /= own.count;
    const auto contract = [&](const double* from, const auto& weights) {
      double sum = 0.0;
      for (std::size_t k = 0; k < own.count; ++k)
        sum += weights[k] * from[k];
      return sum;
    };
    for (std::size_t p = 0; p < left; ++p) {
      const std::size_t from = p * own.count;
      slope[i][p] = contract(&value[from], own.slope);
      for (std::size_t k = i + 1; k < n; ++k)
        slope[k][p] = contract(&slope[k][from], own.value);
      value[p] = contract(&value[from], own.value);
    }
  }
  for (std::size_t i = 0; i < n; ++i)
    slopes[static_cast<Eigen::Index>(i)] = slope[i][0];
  return value[0];
}

}  // namespace mgdd::optimize
