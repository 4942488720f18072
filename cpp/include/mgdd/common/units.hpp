// Physical constants and the one place where field units (bar, kPa, mm, mg, CAD) meet the SI of the core.
#pragma once

#include <numbers>

namespace mgdd::units {

inline constexpr double gas_constant_j_per_molk = 8.314462618;   ///< CODATA 2018, exact to the digits given
inline constexpr double air_molar_mass_kg_per_mol = 28.9647e-3;  ///< dry air, US Standard Atmosphere 1976

inline constexpr double pa_per_bar = 1e5;
inline constexpr double pa_per_kpa = 1e3;
inline constexpr double m_per_mm = 1e-3;
inline constexpr double m3_per_l = 1e-3;
inline constexpr double kg_per_g = 1e-3;
inline constexpr double rad_per_deg = std::numbers::pi / 180.0;

/// Heat of a fuel mass: mg times MJ/kg is exactly J.
inline constexpr double j_per_mg_mj_per_kg = 1.0;

/// Time of one degree of crank angle is 1 / (6 N) s for N in rev/min.
inline constexpr double cad_per_s_per_rpm = 6.0;

}  // namespace mgdd::units
