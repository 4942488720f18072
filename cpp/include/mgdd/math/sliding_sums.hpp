// One row of weights moved along a column: a filter of finite impulse response, the slope of a line through each
// sample. noexcept, no heap. For use inside a dispatched loop.
#pragma once

#include <cstddef>
#include <span>

#include "mgdd/math/dispatch.hpp"

namespace mgdd {

/// sums[k] = sum of weights[j] samples[k + j]. `sums` must not overlap the others.
MGDD_INLINE void sliding_sums(std::span<const double> weights, const double* __restrict samples,
                              std::span<double> sums) noexcept {
  double* const __restrict out = sums.data();
  const std::size_t n = sums.size(), taps = weights.size();
  for (std::size_t k = 0; k < n; ++k)
    out[k] = 0.0;
  std::size_t j = 0;
  for (; j + 4 <= taps; j += 4) {  // four at once: each sum is read and written once for them
    const double a = weights[j], b = weights[j + 1], c = weights[j + 2], d = weights[j + 3];
    const double* const x = samples + j;
    for (std::size_t k = 0; k < n; ++k)
      out[k] = out[k] + a * x[k] + b * x[k + 1] + c * x[k + 2] + d * x[k + 3];
  }
  for (; j < taps; ++j) {
    for (std::size_t k = 0; k < n; ++k)
      out[k] += weights[j] * samples[j + k];
  }
}

}  // namespace mgdd
