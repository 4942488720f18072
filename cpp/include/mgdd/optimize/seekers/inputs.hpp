// The inputs of a seeker as numbers.
#pragma once

#include <Eigen/Core>
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

}  // namespace mgdd::optimize
