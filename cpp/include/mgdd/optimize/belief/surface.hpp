// What a model says of one quantity over several inputs: a table over a grid of its own, read by cubics along every
// axis (`math/cubic_weights.hpp`), with slopes. Beyond the grid its edge holds. Units of the inputs and of the
// quantity. Reading is noexcept and free of allocation.
#pragma once

#include <string>
#include <vector>

#include "mgdd/math/cubic_weights.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"

namespace mgdd::optimize {

class Surface {
 public:
  static constexpr std::size_t most_inputs = 5;  ///< 4^5 nodes are read at once

  /// A table over no input, which says nothing.
  Surface() = default;
  /// Values in rows, the last axis fastest. ShapeError or ParameterError name the axis or the value.
  Surface(std::vector<std::vector<double>> axes, std::vector<double> values);

  bool empty() const noexcept { return axes_.empty(); }
  const std::vector<std::vector<double>>& axes() const noexcept { return axes_; }
  const std::vector<double>& values() const noexcept { return values_; }

  double operator()(const Inputs& at) const noexcept {
    Inputs slopes(at.size());
    return read(at, slopes);
  }
  /// The value, and its slopes per unit of each input; 0 where the edge holds.
  double read(const Inputs& at, Inputs& slopes) const noexcept;

  bool operator==(const Surface&) const = default;

 private:
  std::vector<std::vector<double>> axes_;
  std::vector<double> values_;
};

}  // namespace mgdd::optimize
