// Zero-phase band-pass: a symmetric finite impulse response, the ideal one under a Kaiser window (Kaiser 1974).
// Frequencies are fractions of Nyquist. `apply` neither allocates nor throws.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace mgdd {

/// Gain 1/2 at both edges; within 0.01 % of 1 inside, and below 0.0001 outside, half a transition away from them.
class BandPass {
 public:
  /// ParameterError unless 0 < low < high and 0 < transition < 2 low. A `high` from which no whole transition fits
  /// below Nyquist, or beyond it, makes a high-pass.
  BandPass(double low, double high, double transition);

  /// Samples that a filtered one needs to each of its sides.
  [[nodiscard]] std::size_t reach() const noexcept { return taps_.size() / 2; }

  /// Filters the samples of `column` that have `reach` others to both sides: out.size() == column.size() - 2 reach.
  void apply(std::span<const double> column, std::span<double> out) const noexcept;

  [[nodiscard]] double gain(double frequency) const noexcept;

 private:
  std::vector<double> taps_;  // symmetric
};

}  // namespace mgdd
