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

/// What has come of something by each sample, and the highest of it, at least 0.
struct Cumulative {
  std::vector<double> sum;
  std::size_t peak = 0;
  double best = 0.0;

  void add(double step, std::size_t sample) noexcept;
};

/// Of the steps that lie in [from, to].
struct CumulativeHeat {
  Cumulative net_j, gross_j, pressure_bar;  ///< pressure: by combustion, at the volume of top dead centre
  std::size_t first = 0;                    ///< sample at which the window starts
  bool empty = true;                        ///< no step lies in the window

  [[nodiscard]] const Cumulative& of(BurnFractions which) const noexcept;
};
CumulativeHeat accumulate_heat(const TraceAnalysis& analysis, double from_cad, double to_cad);

/// Pressure rise of every step beyond a polytrope, times its volume over the smallest one (Rassweiler and Withrow 1938;
/// Heywood 1988, section 9.2.2). The exponent is that of compression, then runs to that of expansion between the angles
/// where they are fitted.
std::vector<double> combustion_pressure_bar(const TraceAnalysis& analysis, std::span<const double> pressure_bar);

/// Angle at which a share of the peak is released, linear between samples; NaN without heat.
double burn_angle_cad(const TraceAnalysis& analysis, const CumulativeHeat& heat, BurnFractions which, double share);

}  // namespace mgdd::engine
