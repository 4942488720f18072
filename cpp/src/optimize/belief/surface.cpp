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
  double value = 0.0;
  slopes.setZero();
  while (true) {  // over the nodes around, the last axis fastest
    std::size_t node = 0;
    double weight = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
      node += (on[i].first + step[i]) * stride[i];
      weight *= on[i].value[step[i]];
    }
    value += weight * values_[node];
    for (std::size_t i = 0; i < n; ++i) {
      double slope = on[i].slope[step[i]];
      for (std::size_t j = 0; j < n; ++j) {
        if (j != i) slope *= on[j].value[step[j]];
      }
      slopes[static_cast<Eigen::Index>(i)] += slope * values_[node];
    }
    std::size_t axis = n;
    while (axis > 0 && ++step[axis - 1] == on[axis - 1].count)
      step[--axis] = 0;
    if (axis == 0) return value;
  }
}

}  // namespace mgdd::optimize
