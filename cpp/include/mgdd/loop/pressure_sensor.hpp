// The cylinder-pressure sensor of the virtual bench: the trace of one closed cycle with an error of TDC, gain, offset
// and noise. Angles °CA aTDC as the encoder labels them, pressure bar. `read` is noexcept and allocation-free.
// The model of the sensor is ours.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/math/cubic_weights.hpp"

namespace mgdd::loop {

struct PressureSensorSettings {
  double noise_bar = 0.0;      ///< standard deviation of each sample
  double tdc_error_cad = 0.0;  ///< the label of an angle less the true angle: > 0 reports the cycle late
  double gain_error = 0.0;     ///< [-] share by which pressure reads high
  double offset_bar = 0.0;
  double drift_bar_per_kcycle = 0.0;  ///< of the offset, as of a charge amplifier that warms up
};

/// Angles as labelled, and the pressure read there. Both empty before the first cycle.
struct PressureTrace {
  std::span<const double> angle_cad{};
  std::span<const double> pressure_bar{};
};

class PressureSensor {
 public:
  /// Labels are the grid of the model. The settings are those of a validated bench.
  PressureSensor(const engine::CycleModel<double>& model, const PressureSensorSettings& settings);

  /// The cycle that stands in the workspace of that model, with the noise of `stream` at that cycle; NaN where no such
  /// cycle exists. Labels before IVC read the pressure at IVC, labels after EVO that of an adiabatic expansion.
  PressureTrace read(const engine::CycleModel<double>& model, const engine::CycleWorkspace<double>& work,
                     std::uint64_t seed, std::uint64_t stream, std::int64_t cycle) noexcept;

 private:
  std::vector<double> label_cad_;
  std::vector<std::optional<CubicWeights>> weights_;  // none outside the closed part
  std::vector<double> pressure_bar_;
  PressureSensorSettings settings_;
};

}  // namespace mgdd::loop
