// Weights of a cubic through the four samples around an interval (Lagrange's formula): value and slope at a place
// between them, for any number of columns on one grid. A parabola in the first and last interval. noexcept, no heap.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "mgdd/math/tables.hpp"

namespace mgdd {

struct CubicWeights {
  std::size_t first = 0;  ///< sample that the first weight belongs to
  std::size_t count = 0;
  std::array<double, 4> value{};
  std::array<double, 4> slope{};

  /// Sum over the samples of `y`, which stands on the grid of the weights.
  template <class Column>
  double value_of(const Column& y) const noexcept {
    return sum(value, y);
  }
  template <class Column>
  double slope_of(const Column& y) const noexcept {
    return sum(slope, y);
  }

 private:
  template <class Column>
  double sum(const std::array<double, 4>& weights, const Column& y) const noexcept {
    double total = 0.0;
    for (std::size_t i = 0; i < count; ++i)
      total += weights[i] * y[first + i];
    return total;
  }
};

/// At `at` in the interval [x[k], x[k + 1]] of strictly increasing x; outside it the cubic goes on.
inline CubicWeights cubic_weights(std::span<const double> x, std::size_t k, double at) noexcept {
  CubicWeights w;
  w.first = k > 0 ? k - 1 : 0;
  w.count = std::min(k + 2, x.size() - 1) - w.first + 1;
  const auto node = x.subspan(w.first, w.count);
  for (std::size_t i = 0; i < w.count; ++i) {
    double value = 1.0, slope = 0.0, own = 1.0;
    for (std::size_t j = 0; j < w.count; ++j) {
      if (j == i) continue;
      slope = slope * (at - node[j]) + value;
      value *= at - node[j];
      own *= node[i] - node[j];
    }
    w.value[i] = value / own;
    w.slope[i] = slope / own;
  }
  return w;
}

}  // namespace mgdd
