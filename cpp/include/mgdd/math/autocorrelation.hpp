// How many samples a correlated one is worth: the integrated autocorrelation time of a sequence about zero, by the
// initial monotone sequence of Geyer 1992. Dimensionless, in samples; noexcept, no heap.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace mgdd {

/// tau >= 1: n samples are worth n / tau independent ones. 1 for a sequence of zeros. The mean is not taken off: an
/// offset of a residual is a correlation like any other.
inline double autocorrelation_time(std::span<const double> r) noexcept {
  const std::size_t n = r.size();
  const auto product = [&](std::size_t lag) {
    double sum = 0.0;
    for (std::size_t i = 0; i + lag < n; ++i)
      sum += r[i] * r[i + lag];
    return sum;
  };
  const double power = product(0);
  if (!(power > 0.0)) return 1.0;
  double tau = -1.0, least = 2.0;
  for (std::size_t lag = 0; 2 * lag + 2 < n; lag += 2) {
    const double pair = (product(lag) + product(lag + 1)) / power;
    if (!(pair > 0.0)) break;
    least = std::min(least, pair);
    tau += 2.0 * least;
  }
  return std::max(tau, 1.0);
}

}  // namespace mgdd
