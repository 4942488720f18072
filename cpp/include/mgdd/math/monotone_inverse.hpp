// Inverse of a function that does not fall, by the ITP method: bisection that interpolates where it pays, no
// derivative, no failure, never more than one evaluation beyond bisection. Units are those of the function. noexcept as
// the function is, heap-free. Oliveira and Takahashi 2020, section 2, with kappa_1 = 0.2/(high - low), kappa_2 = 2, n_0
// = 1.
#pragma once

#include <algorithm>
#include <cmath>

namespace mgdd {

/// Smallest x in [low, high] with f(x) >= target, at most 2e-13 of the interval above it; `high` where there is none.
template <class F>
double monotone_inverse(const F& f, double target, double low, double high) noexcept(noexcept(f(low))) {
  constexpr double half_tolerance = 1e-13;
  double below = f(low) - target, above = f(high) - target;
  if (below >= 0.0) return low;
  if (!(above > 0.0)) return high;
  const double range = high - low, tolerance = half_tolerance * range;
  double radius = range;  // what bisection with one step to spare would leave; halved per step
  while (high - low > 2.0 * tolerance) {
    const double middle = 0.5 * (low + high), width = high - low;
    const double secant = (above * low - below * high) / (above - below);
    const double side = middle >= secant ? 1.0 : -1.0;
    const double cut = 0.2 * width * width / range;
    const double inner = cut <= std::abs(middle - secant) ? secant + side * cut : middle;
    const double slack = std::fmax(radius - 0.5 * width, 0.0);
    const double aimed = std::abs(inner - middle) <= slack ? inner : middle - side * slack;
    // Near the root the cut is below rounding: a step of the tolerance closes the far end.
    const double x = std::clamp(aimed, low + tolerance, high - tolerance);
    if (!(x > low && x < high)) break;  // nothing lies between them
    const double value = f(x) - target;
    if (value >= 0.0) {
      high = x;
      above = value;
    } else {
      low = x;
      below = value;
    }
    radius *= 0.5;
  }
  return high;
}

}  // namespace mgdd
