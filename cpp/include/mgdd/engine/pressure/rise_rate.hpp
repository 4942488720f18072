// The steepest pressure rise of a trace, as a number that does not depend on the sampling. noexcept and without heap
// after construction.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

/// Width of the least-squares line whose slope is the pressure rise rate [CAD].
inline constexpr double rise_rate_width_cad = 2.0;

struct SteepestRise {
  double bar_per_cad = -std::numeric_limits<double>::infinity();
  double at_cad = undefined<double>();  ///< middle of the line
};

/// Largest slope of the least-squares line over 2 CAD. Between samples farther apart than 0.25 CAD the line is taken
/// through values of a cubic.
class RiseRate {
 public:
  explicit RiseRate(std::span<const double> angle_cad);

  /// `pressure_bar` has one sample per angle.
  SteepestRise operator()(const double* pressure_bar) const noexcept;

 private:
  struct Line {
    std::size_t first;  // sample that its first weight belongs to
    double at_cad;
  };
  std::vector<Line> lines_;
  std::vector<double> weights_;  // a row of `taps_` per line, or one row for all of them
  std::size_t taps_ = 0;
  bool alike_ = false;  // one row of weights, which moves on by one sample
};

}  // namespace mgdd::engine
