// The indicators of one cycle from what a pass over its pressure trace has found; whoever integrates, one cycle or many
// in lanes, ends here. SI in, conventional units out. noexcept, no heap.
#pragma once

#include <cstddef>
#include <span>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/gas.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

/// Sums and places along one pressure trace.
template <class T>
struct TraceSums {
  T work_closed_j{0.0};  ///< trapezoid of p dV
  T heat_loss_j{0.0};
  T last_pressure_pa{0.0};
  std::size_t p_max_at = 0, t_max_at = 0;  ///< samples, the first of equal ones
  std::size_t dp_max_at = 0;               ///< step k -> k + 1
};

/// All but the burn angles, which belong to the burn law. `pressure(k)` gives sample k, around the places of `sums`.
template <class T, class Pressure>
Indicators<T> indicators_of(const GasParameters<T>& gas, const Geometry<T>& geometry, const Charge<T>& charge,
                            std::span<const double> angles_cad, std::span<const T> volume_m3, const TraceSums<T>& sums,
                            const Pressure& pressure) noexcept {
  const std::size_t n = angles_cad.size();
  const auto around = [&](std::size_t k, const auto& sample) {
    return parabola_peak<T>(angles_cad, k, sample(k > 0 ? k - 1 : k), sample(k), sample(k + 1 < n ? k + 1 : k));
  };
  const Peak<T> p_peak = around(sums.p_max_at, pressure);
  const Peak<T> t_peak =
      around(sums.t_max_at, [&](std::size_t k) { return T(pressure(k) * volume_m3[k] / charge.gas_j_per_k); });
  const std::size_t steep = sums.dp_max_at;
  const T slope = (pressure(steep + 1) - pressure(steep)) / (angles_cad[steep + 1] - angles_cad[steep]);

  // Gross work: the ideal remainder of -180..180 CAD, intake pressure before IVC and the blow-down mean after EVO.
  const T& closed = sums.work_closed_j;
  const T bottom = geometry.clearance_m3 + geometry.swept_m3;
  const T gross = closed + charge.intake_pa * (volume_m3[0] - bottom) +
                  0.5 * (sums.last_pressure_pa + charge.intake_pa) * (bottom - volume_m3[n - 1]);

  Indicators<T> out;
  out.work_closed_j = closed;
  out.work_gross_j = gross;
  out.imep_closed_bar = closed / geometry.swept_m3 / units::pa_per_bar;
  out.imep_gross_bar = gross / geometry.swept_m3 / units::pa_per_bar;
  out.p_max_bar = p_peak.value / units::pa_per_bar;
  out.p_max_cad = p_peak.angle_cad;
  out.t_max_k = t_peak.value;
  out.t_max_cad = t_peak.angle_cad;
  out.dp_max_bar_per_cad = slope / units::pa_per_bar;
  out.dp_max_cad = T(0.5 * (angles_cad[steep] + angles_cad[steep + 1]));
  out.heat_loss_j = sums.heat_loss_j;
  out.ringing_intensity_mw_per_m2 =
      ringing_intensity_mw_per_m2(T(gamma_at(gas, t_peak.value)),
                                  T(slope * charge.speed_rpm * units::cad_per_s_per_rpm), p_peak.value, t_peak.value);
  if (value_of(charge.fuel_heat_j) > 0.0) {
    out.efficiency_gross = gross / charge.fuel_heat_j;
    out.heat_loss_fraction = sums.heat_loss_j / charge.fuel_heat_j;
  }
  return out;
}

}  // namespace mgdd::engine
