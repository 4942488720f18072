#include "mgdd/optimize/belief/surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mgdd/common/error.hpp"

namespace mgdd::optimize {
namespace {

// A table without its first axis, `left` numbers for each of its nodes; `to` may be `from`.
void contract(const double* from, std::size_t left, std::size_t count, const std::array<double, 4>& weights,
              double* to) noexcept {
  const auto part = [&](std::size_t k) {  // weights beyond the last node are 0
    return weights[k] *
           Eigen::Map<const Eigen::ArrayXd>(from + (k < count ? k * left : 0), static_cast<Eigen::Index>(left));
  };
  Eigen::Map<Eigen::ArrayXd>(to, static_cast<Eigen::Index>(left)) = part(0) + part(1) + part(2) + part(3);
}

}  // namespace

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
  std::size_t nodes = 1, node = 0;
  for (std::size_t i = n; i-- > 0;) {
    const auto own = static_cast<Eigen::Index>(i);
    const double held = std::clamp(at[own], axes_[i].front(), axes_[i].back());
    on[i] = cubic_weights(axes_[i], interval_of(axes_[i], held), held);
    if (held != at[own]) on[i].slope.fill(0.0);
    stride[i] = nodes;
    nodes *= axes_[i].size();
    node += on[i].first * stride[i];
  }
  // The nodes around side by side, the last axis fastest, then without their first axis, and so on: what is left of the
  // value and of every slope.
  constexpr std::size_t most = 1024;
  static_assert(most_inputs == 5);  // of four nodes each
  // Written before they are read: to fill 18 KB first takes a search for a map 3 % more time.
  // NOLINTBEGIN(cppcoreguidelines-pro-type-member-init)
  std::array<double, most> value;
  std::array<std::array<double, most / 4>, most_inputs> slope;  // per axis
  // NOLINTEND(cppcoreguidelines-pro-type-member-init)
  std::size_t left = 0;
  for (bool more = true; more;) {
    for (std::size_t k = 0; k < on[n - 1].count; ++k)
      value[left++] = values_[node + k];
    more = false;
    for (std::size_t axis = n - 1; axis-- > 0 && !more;) {
      more = ++step[axis] < on[axis].count;
      node += stride[axis];
      if (more) continue;
      step[axis] = 0;
      node -= on[axis].count * stride[axis];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    left /= on[i].count;
    contract(value.data(), left, on[i].count, on[i].slope, slope[i].data());
    contract(value.data(), left, on[i].count, on[i].value, value.data());
    for (std::size_t k = 0; k < i; ++k)
      contract(slope[k].data(), left, on[i].count, on[i].value, slope[k].data());
  }
  for (std::size_t i = 0; i < n; ++i)
    slopes[static_cast<Eigen::Index>(i)] = slope[i][0];
  return value[0];
}

}  // namespace mgdd::optimize
