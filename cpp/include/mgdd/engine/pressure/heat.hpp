// Heat of the steps of a trace, its cumulative value over a window, and the angles where shares of it are released.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/engine/pressure/trace_analysis.hpp"

namespace mgdd::engine {

/// Net heat of one step: dQ = dU + W with U = p V/(gamma - 1) at the step's gamma (Krieger and Borman 1966), in the
/// trapezoidal form that the default integrator inverts exactly. Any consistent units.
inline double net_heat(double gamma, double p0, double v0, double p1, double v1) noexcept {
  return (p1 * v1 - p0 * v0) / (gamma - 1.0) + 0.5 * (p0 + p1) * (v1 - v0);
}

/// Angle at which rising heat first reaches a level, linear between samples `first` and `peak`; NaN where it does not.
double level_angle_cad(std::span<const double> angle_cad, std::span<const double> heat, std::size_t first,
                       std::size_t peak, double level) noexcept;

/// Cumulative heat of the steps that lie in [from, to], one value per sample.
struct CumulativeHeat {
  std::vector<double> net_j, gross_j;
  std::size_t first = 0;                        ///< sample at which the window starts
  std::size_t net_peak = 0, gross_peak = 0;     ///< samples of the highest values
  double net_best_j = 0.0, gross_best_j = 0.0;  ///< those values, at least 0
  bool empty = true;                            ///< no step lies in the window
};
CumulativeHeat accumulate_heat(const TraceAnalysis& analysis, double from_cad, double to_cad);

/// Angle at which a share of the peak is released, linear between samples; NaN without heat.
double burn_angle_cad(const TraceAnalysis& analysis, const CumulativeHeat& heat, bool gross, double share);

}  // namespace mgdd::engine
