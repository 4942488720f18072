// The indicators of one cycle from what a pass over its pressure trace has found; whoever integrates, one cycle or many
// in lanes, ends here. SI in, conventional units out. noexcept, no heap.
#pragma once

#include <cstddef>
#include <span>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/select.hpp"

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

/// The numbers behind the indicators, taken from a trace.
template <class T>
struct TraceFigures {
  T work_closed_j, heat_loss_j, last_pressure_pa;
  PeakSamples<T> pressure_pa, energy_j;  ///< energy is p V
  typename PeakSamples<T>::Angle steep_from_cad, steep_to_cad;
  T steep_from_pa, steep_to_pa;  ///< ends of the steepest step
};

/// `pressure(k)` gives sample k, around the places of `sums`.
template <class T, class Pressure>
TraceFigures<T> figures_of(std::span<const double> angles_cad, std::span<const T> volume_m3, const TraceSums<T>& sums,
                           const Pressure& pressure) noexcept {
  const std::size_t steep = sums.dp_max_at;
  const auto energy = [&](std::size_t k) { return T(pressure(k) * volume_m3[k]); };
  return {sums.work_closed_j,
          sums.heat_loss_j,
          sums.last_pressure_pa,
          samples_around<T>(angles_cad, sums.p_max_at, pressure),
          samples_around<T>(angles_cad, sums.t_max_at, energy),
          angles_cad[steep],
          angles_cad[steep + 1],
          pressure(steep),
          pressure(steep + 1)};
}

/// Volumes that close the cycle.
template <class T>
struct CycleVolumes {
  T first_m3, last_m3, bottom_m3, swept_m3;

  CycleVolumes(const Geometry<T>& geometry, std::span<const T> volume_m3) noexcept
      : first_m3(volume_m3.front()),
        last_m3(volume_m3.back()),
        bottom_m3(geometry.clearance_m3 + geometry.swept_m3),
        swept_m3(geometry.swept_m3) {}
};

/// All but the burn angles, which belong to the burn law. T is double, Dual<N>, or Lanes<N> for cycles side by side;
/// `gamma(t_k)` is that of the gas.
template <class T, class V, class Gamma>
MGDD_INLINE Indicators<T> indicators_of(const TraceFigures<T>& f, const Charge<T>& charge,
                                        const CycleVolumes<V>& volume, const Gamma& gamma) noexcept {
  const T bottom(volume.bottom_m3), swept(volume.swept_m3);
  const Peak<T> p_peak = parabola_peak(f.pressure_pa);
  PeakSamples<T> temperature = f.energy_j;
  for (T* energy : {&temperature.before, &temperature.at, &temperature.after})
    *energy = *energy / charge.gas_j_per_k;
  const Peak<T> t_peak = parabola_peak(temperature);
  const T slope = (f.steep_to_pa - f.steep_from_pa) / (f.steep_to_cad - f.steep_from_cad);

  // Gross work: the ideal remainder of -180..180 CAD, intake pressure before IVC and the blow-down mean after EVO.
  const T& closed = f.work_closed_j;
  const T gross = closed + charge.intake_pa * (T(volume.first_m3) - bottom) +
                  0.5 * (f.last_pressure_pa + charge.intake_pa) * (bottom - T(volume.last_m3));

  Indicators<T> out;
  out.work_closed_j = closed;
  out.work_gross_j = gross;
  out.imep_closed_bar = closed / swept / units::pa_per_bar;
  out.imep_gross_bar = gross / swept / units::pa_per_bar;
  out.p_max_bar = p_peak.value / units::pa_per_bar;
  out.p_max_cad = p_peak.angle_cad;
  out.t_max_k = t_peak.value;
  out.t_max_cad = t_peak.angle_cad;
  out.dp_max_bar_per_cad = slope / units::pa_per_bar;
  out.dp_max_cad = T(0.5 * (f.steep_from_cad + f.steep_to_cad));
  out.heat_loss_j = f.heat_loss_j;
  out.ringing_intensity_mw_per_m2 = ringing_intensity_mw_per_m2(
      T(gamma(t_peak.value)), T(slope * charge.speed_rpm * units::cad_per_s_per_rpm), p_peak.value, t_peak.value);
  const auto fired = charge.fuel_heat_j > T(0.0);
  out.efficiency_gross = select(fired, T(gross / charge.fuel_heat_j), undefined<T>());
  out.heat_loss_fraction = select(fired, T(f.heat_loss_j / charge.fuel_heat_j), undefined<T>());
  return out;
}

}  // namespace mgdd::engine
