// The gas that a cycle holds between IVC and EVO, as amount times R: p V = gas T. It comes from a stated mass, from the
// state at IVC, or from the intake conditions (Tan 2018, eq. 2-3). SI; noexcept, no heap.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"

namespace mgdd::engine {

/// Warming of the charge from the intake to IVC [K] by port, walls and residual gas, where a measured trace has neither
/// a mass nor a temperature at IVC. The stated masses of the four heavy-duty traces of the package give 32 to 46 K.
inline constexpr double ivc_warming_k = 40.0;
/// Exponent that carries the pressure of the first samples back to IVC; 0.05 more is 0.2 % of mass over 10 CAD.
inline constexpr double ivc_polytropic_exponent = 1.35;
/// Length of the mean that gives p(IVC) of a measured trace [CAD].
inline constexpr double ivc_mean_cad = 5.0;
/// A trace that starts later than this after IVC [CAD] does not give the trapped mass.
inline constexpr double ivc_carry_cad = 15.0;

template <class T>
T gas_of_mass_j_per_k(const T& mass_g) noexcept {
  return mass_g * (units::kg_per_g * units::gas_constant_j_per_molk / units::air_molar_mass_kg_per_mol);
}
template <class T>
T mass_of_gas_g(const T& gas_j_per_k) noexcept {
  return gas_j_per_k * (units::air_molar_mass_kg_per_mol / (units::gas_constant_j_per_molk * units::kg_per_g));
}

/// Temperature at IVC of a measured trace: the point's own, or the intake temperature plus `ivc_warming_k`.
template <class T>
T ivc_temperature_k(const BasicOperatingPoint<T>& point) noexcept {
  return point.ivc_temperature_k ? *point.ivc_temperature_k : point.intake_temperature_k + ivc_warming_k;
}

/// Gas of a simulated cycle: the point's mass; p(IVC) V(IVC)/T(IVC) where the point states that temperature; else
/// eta_V p_in V_s/T_in (Tan 2018, eq. 2-3).
template <class T>
T simulated_gas_j_per_k(const BasicCylinder<T>& cylinder, const Geometry<T>& geometry,
                        const BasicOperatingPoint<T>& point, const T& intake_pa, const T& ivc_pa) noexcept {
  if (point.trapped_mass_g) return gas_of_mass_j_per_k(*point.trapped_mass_g);
  if (point.ivc_temperature_k) {
    return ivc_pa * geometry.volume_m3(value_of(cylinder.geometry.ivc_cad)) / *point.ivc_temperature_k;
  }
  return cylinder.gas.volumetric_efficiency * intake_pa * geometry.swept_m3 / point.intake_temperature_k;
}

/// p(IVC) of a measured trace: the mean of its first `ivc_mean_cad`, carried back along p V^1.35. In the unit given.
template <class T>
T ivc_pressure(std::span<const double> angle_cad, std::span<const double> pressure, const Geometry<T>& geometry,
               double ivc_cad) noexcept {
  using std::pow;
  const T volume = geometry.volume_m3(ivc_cad);
  T sum(0.0);
  std::size_t n = 0;
  for (; n < angle_cad.size() && angle_cad[n] <= angle_cad[0] + ivc_mean_cad; ++n) {
    sum += pressure[n] * pow(geometry.volume_m3(angle_cad[n]) / volume, ivc_polytropic_exponent);
  }
  return sum * (1.0 / static_cast<double>(n));
}

/// Gas of a measured trace: the point's mass, or p V/T at IVC. The intake pressure of the point is not used.
template <class T>
T measured_gas_j_per_k(std::span<const double> angle_cad, std::span<const double> pressure_bar,
                       const Geometry<T>& geometry, double ivc_cad, const BasicOperatingPoint<T>& point) noexcept {
  if (point.trapped_mass_g) return gas_of_mass_j_per_k(*point.trapped_mass_g);
  return ivc_pressure(angle_cad, pressure_bar, geometry, ivc_cad) * units::pa_per_bar * geometry.volume_m3(ivc_cad) /
         ivc_temperature_k(point);
}

}  // namespace mgdd::engine
