// Zero-phase low-pass: a second-order Butterworth run forward and backward over a column continued by reflection.
// Dimensionless; frequencies are fractions of Nyquist in (0, 1). `apply` neither allocates nor throws.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace mgdd {

/// As a matrix it is symmetric with norm 1, because the reflection repeats the end samples: it keeps a constant, and
/// scales the cosine cos(pi k (t + 1/2) / samples) by gain(cutoff, k / samples).
class ZeroPhaseLowPass {
 public:
  static constexpr double least_cutoff = 0.01;
  static constexpr double largest_cutoff = 0.99;

  /// ParameterError unless samples >= 1 and the cutoff lies in [0.01, 0.99].
  ZeroPhaseLowPass(std::size_t samples, double cutoff);

  /// Filters in place; the column must have the length given at construction.
  void apply(std::span<double> column) noexcept;

  /// 1 / (1 + (tan(pi f / 2) / tan(pi fc / 2))^4): 1/2 at the cutoff, because both runs take 3 dB.
  [[nodiscard]] static double gain(double cutoff, double frequency) noexcept;

 private:
  void run(bool backward) noexcept;

  double b0_ = 1.0, a1_ = 0.0, a2_ = 0.0;  // H = b0 (1 + z^-1)^2 / (1 + a1 z^-1 + a2 z^-2)
  std::size_t pad_ = 0;                    // long enough for the start of a run to fade below rounding
  std::vector<double> work_;
};

}  // namespace mgdd
