// Least-squares straight line through weighted points, from running sums. No heap; dimensionless.
#pragma once

namespace mgdd {

struct LineFit {
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;

  /// A weight of -1 takes a point away again.
  constexpr void add(double x, double y, double weight = 1.0) noexcept {
    n += weight, sx += weight * x, sy += weight * y, sxx += weight * x * x, sxy += weight * x * y;
  }
  /// Not a number with fewer than two different x.
  [[nodiscard]] constexpr double slope() const noexcept { return (n * sxy - sx * sy) / (n * sxx - sx * sx); }
  /// Value of the line at x = 0.
  [[nodiscard]] constexpr double intercept() const noexcept { return (sy - slope() * sx) / n; }
};

}  // namespace mgdd
