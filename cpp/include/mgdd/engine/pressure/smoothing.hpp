// Smoothing of a pressure trace before it is differentiated, without a shift of phase. One smoother serves every cycle
// on the same angles. Savitzky and Golay 1964 (local parabola); Butterworth forward and backward (`zero_phase.hpp`).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "mgdd/engine/pressure/trace_options.hpp"
#include "mgdd/math/zero_phase.hpp"

namespace mgdd::engine {

/// `automatic` is a local parabola over `smoothing_width_cad` where at least this many samples fall into it, else none:
/// coarser traces are averages, and five samples would bend their burn.
inline constexpr std::size_t automatic_smoothing_samples = 9;

class Smoother {
 public:
  /// ParameterError for a width with fewer than 5 samples or a cutoff outside 1 to 99 % of Nyquist; DataError for
  /// `low_pass` on uneven angles.
  Smoother(const std::vector<double>& angle_cad, double speed_rpm, const TraceOptions& options);

  std::vector<double> operator()(const std::vector<double>& column) const;

  /// What acts: "none", "savitzky_golay over 4 °CA (21 samples)", "low_pass at 3000 Hz".
  const std::string& name() const noexcept { return name_; }

 private:
  // Windows shrink towards both ends and stay symmetric in samples.
  std::vector<double> angle_, weights_;  // the weights of even angles
  std::size_t reach_ = 0;                // samples to each side
  bool mean_ = false;
  std::optional<ZeroPhaseLowPass> low_pass_;
  std::string name_ = "none";
};

}  // namespace mgdd::engine
