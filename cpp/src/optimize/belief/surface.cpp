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
  // Rows of nodes around along the last axis, which lie side by side, then without their last axis, and so on: what is
  // left of the value and of every slope.
  constexpr Eigen::Index rows = 256;
  static_assert(most_inputs == 5);  // of four nodes each
  Eigen::Array<double, rows, 1> value;
  Eigen::Array<double, rows, most_inputs> slope;  // a column per axis
  const auto contract = [](const double* from, const std::array<double, 4>& weights, std::size_t count) {
    double sum = 0.0;
    for (std::size_t k = 0; k < count; ++k)
      sum += weights[k] * from[k];
    return sum;
  };
  const auto axes = static_cast<Eigen::Index>(n);
  std::size_t node = 0;
  for (std::size_t i = 0; i < n; ++i)
    node += on[i].first * stride[i];
  Eigen::Index left = 0;
  for (bool more = true; more; ++left) {
    value[left] = contract(&values_[node], on[n - 1].value, on[n - 1].count);
    slope(left, axes - 1) = contract(&values_[node], on[n - 1].slope, on[n - 1].count);
    more = false;
    for (std::size_t axis = n - 1; axis-- > 0 && !more;) {
      more = ++step[axis] < on[axis].count;
      node += stride[axis];
      if (more) continue;
      step[axis] = 0;
      node -= on[axis].count * stride[axis];
    }
  }
  for (Eigen::Index i = axes - 1; i-- > 0;) {
    const CubicWeights& own = on[static_cast<std::size_t>(i)];
    const auto count = static_cast<Eigen::Index>(own.count);
    left /= count;
    for (Eigen::Index p = 0; p < left; ++p) {
      const Eigen::Index from = p * count;
      slope(p, i) = contract(&value[from], own.slope, own.count);
      for (Eigen::Index k = i + 1; k < axes; ++k)
        slope(p, k) = contract(&slope(from, k), own.value, own.count);
      value[p] = contract(&value[from], own.value, own.count);
    }
  }
  slopes = slope.row(0).head(axes).matrix().transpose();
  return value[0];
}

}  // namespace mgdd::optimize
