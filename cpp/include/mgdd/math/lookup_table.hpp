// A look-up table over one or two named axes that owns its cells, as a calibration map of an engine does: linear or
// bilinear between the cells, the edge outside of the axes with a flag that says so. A cell may hold NaN where there is
// no value; what takes part of it is NaN. Values and axes in their own units. `at` is noexcept and allocation-free; to
// make a table is offline code.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/math/tables.hpp"

namespace mgdd {

struct TableAxis {
  std::string name;
  std::vector<double> entries;  ///< two or more, finite and strictly increasing
};

struct TableValue {
  double value = std::numeric_limits<double>::quiet_NaN();
  bool held_outside = true;  ///< the point lies outside of the axes: the value is that of the edge
};

template <std::size_t n_axes>
class LookupTable {
  static_assert(n_axes == 1 || n_axes == 2);

 public:
  /// Cells in rows, the last axis fastest. ShapeError or ParameterError naming the axis, its entry or `values`.
  LookupTable(std::array<TableAxis, n_axes> axes, std::vector<double> values)
      : axes_(std::move(axes)), values_(std::move(values)) {
    std::size_t cells = 1;
    for (const TableAxis& axis : axes_) {
      require_axis(axis.name, axis.entries);
      cells *= axis.entries.size();
    }
    if (values_.size() != cells) {
      throw about("values", ShapeError("values has " + std::to_string(values_.size()) + " entries: the axes have " +
                                       std::to_string(cells) + " cells"));
    }
    for (std::size_t i = 0; i < values_.size(); ++i) {
      if (std::isinf(values_[i])) {
        throw ParameterError("values[" + std::to_string(i) + "]", values_[i], "must not be infinite");
      }
    }
  }

  /// NaN, which counts as outside, for a coordinate that is NaN.
  TableValue at(double x) const noexcept
    requires(n_axes == 1)
  {
    if (std::isnan(x)) return {};
    return read(place_in(axes_[0].entries, x));
  }
  TableValue at(double x, double y) const noexcept
    requires(n_axes == 2)
  {
    if (std::isnan(x) || std::isnan(y)) return {};
    return read(place_in(axes_[0].entries, axes_[1].entries, x, y));
  }
  TableValue at(std::span<const double, n_axes> point) const noexcept {
    if constexpr (n_axes == 1) {
      return at(point[0]);
    } else {
      return at(point[0], point[1]);
    }
  }

  const std::array<TableAxis, n_axes>& axes() const noexcept { return axes_; }
  const std::vector<double>& values() const noexcept { return values_; }

 private:
  template <std::size_t corners>
  TableValue read(const TablePlace<corners>& place) const noexcept {
    return {place.value_of(values_), place.outside};
  }

  std::array<TableAxis, n_axes> axes_;
  std::vector<double> values_;
};

}  // namespace mgdd
