// The inputs of a seeker as numbers.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace mgdd::optimize {

inline constexpr int max_inputs = 8;
inline constexpr double unlimited = std::numeric_limits<double>::infinity();

/// One number per input; at most eight, so that it never allocates.
using Inputs = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_inputs, 1>;
using InputMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_inputs, max_inputs>;

/// A single input as a column.
inline Inputs scalar_input(double value) {
  return Inputs::Constant(1, value);
}

/// What can be set of each input: `from` and whole steps of `size` above it, up to `to`; size 0: any value.
struct Steps {
  Inputs size, from, to;

  bool any() const noexcept { return (size.array() > 0.0).any(); }

  /// The nearest that can be set; where that has an excess over a limit, the step on the other side of `wanted` which
  /// has the least.
  template <class Excess>
  Inputs nearest(const Inputs& wanted, const Excess& excess) const noexcept {
    Inputs out = wanted;
    for (Eigen::Index i = 0; i < size.size(); ++i)
      if (size[i] > 0.0) out[i] = set(i, std::round(count(i, wanted[i])));
    if (!any()) return out;
    double least = excess(out);
    for (Eigen::Index i = 0; i < size.size() && least > 0.0; ++i) {
      if (!(size[i] > 0.0) || out[i] == wanted[i]) continue;
      Inputs other = out;
      other[i] = set(i, out[i] > wanted[i] ? std::floor(count(i, wanted[i])) : std::ceil(count(i, wanted[i])));
      const double there = excess(other);
      if (there >= least) continue;
      least = there;
      out = other;
    }
    return out;
  }

 private:
  double count(Eigen::Index i, double value) const noexcept { return (value - from[i]) / size[i]; }
  double set(Eigen::Index i, double steps) const noexcept {
    constexpr double rounding = 1e-9;  // steps: the bound itself may be one
    return std::min(from[i] + std::min(steps, std::floor(count(i, to[i]) + rounding)) * size[i], to[i]);
  }
};

}  // namespace mgdd::optimize
