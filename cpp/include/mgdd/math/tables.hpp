// Look-up tables over one or two strictly increasing axes: linear or bilinear between the entries, the edge outside of
// the axes. A place holds the cells around a point and their weights, which add up to one; units are those of the
// table. noexcept and heap-free but for the checks, which are offline code.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>

#include "mgdd/common/error.hpp"

namespace mgdd {

/// The interval of `at`: the last k with x[k] <= at, at most the last interval; the first one where `at` is before
/// x[0].
inline std::size_t interval_of(std::span<const double> x, double at) noexcept {
  const auto after = std::upper_bound(x.begin(), x.end(), at) - x.begin();
  return std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(after, 1)) - 1, x.size() - 2);
}

/// The interval of an axis that holds a number, and the share of it that lies below.
struct AxisPlace {
  std::size_t low = 0;
  double share = 0.0;
  bool outside = false;  ///< held at the edge
};

/// NaN has a share of NaN: who may meet it asks before.
inline AxisPlace place_on(std::span<const double> axis, double at) noexcept {
  const std::size_t low = interval_of(axis, at);
  return {low, std::clamp((at - axis[low]) / (axis[low + 1] - axis[low]), 0.0, 1.0),
          at < axis.front() || at > axis.back()};
}

/// Cells around a point and their weights: two on a line, four on a plane.
template <std::size_t n>
struct TablePlace {
  std::array<std::size_t, n> cell{};
  std::array<double, n> weight{};
  bool outside = false;

  /// A cell without weight does not count, whatever it holds: NaN marks cells without a value.
  template <class Column>
  double value_of(const Column& cells) const noexcept {
    double total = 0.0;
    for (std::size_t c = 0; c < n; ++c) {
      if (weight[c] != 0.0) total += weight[c] * cells[cell[c]];
    }
    return total;
  }
};

inline TablePlace<2> place_in(std::span<const double> axis, double at) noexcept {
  const AxisPlace x = place_on(axis, at);
  return {{x.low, x.low + 1}, {1.0 - x.share, x.share}, x.outside};
}

/// Cells in rows, the last axis fastest.
inline TablePlace<4> place_in(std::span<const double> rows, std::span<const double> columns, double row,
                              double column) noexcept {
  const AxisPlace y = place_on(rows, row), x = place_on(columns, column);
  const std::size_t first = y.low * columns.size() + x.low, next = first + columns.size();
  return {{first, first + 1, next, next + 1},
          {(1.0 - y.share) * (1.0 - x.share), (1.0 - y.share) * x.share, y.share * (1.0 - x.share), y.share * x.share},
          y.outside || x.outside};
}

/// ShapeError or ParameterError naming the axis or its entry, unless it has two or more finite, increasing entries.
inline void require_axis(const std::string& name, std::span<const double> axis) {
  if (axis.size() < 2) {
    throw about(name, ShapeError(name + " has " + std::to_string(axis.size()) + " entries: must have at least two"));
  }
  for (std::size_t i = 0; i < axis.size(); ++i) {
    const std::string entry = name + "[" + std::to_string(i) + "]";
    if (!std::isfinite(axis[i])) throw ParameterError(entry, axis[i], "must be finite");
    if (i > 0 && !(axis[i] > axis[i - 1])) throw ParameterError(entry, axis[i], "must be above the entry before it");
  }
}

}  // namespace mgdd
