// A figure that is linear in the samples of a column: a constant and the sum of weights times samples. noexcept, no
// heap after construction.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "mgdd/math/dispatch.hpp"

namespace mgdd {

struct WeightedSum {
  std::size_t first = 0;  ///< sample that the first weight belongs to
  std::vector<double> weights;
  double constant = 0.0;

  bool empty() const noexcept { return weights.empty(); }

  /// `samples` is the whole column. In a fixed order of sums, so that every instruction set gives the same bits.
  MGDD_INLINE double operator()(const double* samples) const noexcept {
    constexpr std::size_t side_by_side = 16;
    std::array<double, side_by_side> sums{};
    const double* const x = samples + first;
    const double* const w = weights.data();
    const std::size_t n = weights.size(), blocks = n - n % side_by_side;
    for (std::size_t k = 0; k < blocks; k += side_by_side) {
      for (std::size_t i = 0; i < side_by_side; ++i)
        sums[i] += w[k + i] * x[k + i];
    }
    double total = constant;
    for (const double sum : sums)
      total += sum;
    for (std::size_t k = blocks; k < n; ++k)
      total += w[k] * x[k];
    return total;
  }
};

}  // namespace mgdd
