#include "mgdd/math/zero_phase.hpp"

#include <cmath>
#include <numbers>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd {

ZeroPhaseLowPass::ZeroPhaseLowPass(std::size_t samples, double cutoff) {
  if (samples < 1) {
    throw about("samples", ParameterError("samples = 0: must be >= 1"));
  }
  if (!(cutoff >= least_cutoff && cutoff <= largest_cutoff)) {
    throw ParameterError("cutoff", cutoff, "must be in [0.01, 0.99] of Nyquist");
  }
  // Bilinear transform of the analogue filter, its cutoff prewarped.
  const double k = std::tan(0.5 * std::numbers::pi * cutoff);
  const double norm = 1.0 + std::numbers::sqrt2 * k + k * k;
  b0_ = k * k / norm;
  a1_ = 2.0 * (k * k - 1.0) / norm;
  a2_ = (1.0 - std::numbers::sqrt2 * k + k * k) / norm;
  // The poles are conjugate with radius sqrt(a2): after 40 time constants nothing is left of how a run began.
  pad_ = 2 + static_cast<std::size_t>(std::ceil(-80.0 / std::log(a2_)));
  work_.resize(samples + 2 * pad_);
}

void ZeroPhaseLowPass::apply(std::span<double> column) noexcept {
  const std::size_t n = column.size();
  const std::size_t period = 2 * n;
  // Where work_[0] stands in the periodic sequence of the column and its mirror image.
  std::size_t at = (period - pad_ % period) % period;
  for (double& value : work_) {
    value = column[at < n ? at : period - 1 - at];
    at = at + 1 == period ? 0 : at + 1;
  }
  run(false);
  run(true);
  for (std::size_t i = 0; i < n; ++i) {
    column[i] = work_[pad_ + i];
  }
}

void ZeroPhaseLowPass::run(bool backward) noexcept {
  double s1 = 0.0;
  double s2 = 0.0;
  const std::size_t size = work_.size();
  for (std::size_t i = 0; i < size; ++i) {
    double& x = work_[backward ? size - 1 - i : i];
    const double y = b0_ * x + s1;
    s1 = 2.0 * b0_ * x - a1_ * y + s2;
    s2 = b0_ * x - a2_ * y;
    x = y;
  }
}

double ZeroPhaseLowPass::gain(double cutoff, double frequency) noexcept {
  const double ratio = std::tan(0.5 * std::numbers::pi * frequency) / std::tan(0.5 * std::numbers::pi * cutoff);
  const double square = ratio * ratio;
  return 1.0 / (1.0 + square * square);
}

}  // namespace mgdd
