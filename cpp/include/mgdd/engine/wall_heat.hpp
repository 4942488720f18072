// Heat from the gas to the wall: the film coefficients of Woschni 1967 and Hohenberg 1979 [W/(m2 K)], pressure in bar and
// lengths in m, and the same laws arranged for the step of a cycle, where most powers cancel. noexcept, no heap.
#pragma once

#include <cmath>

#include "mgdd/common/dual.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"

namespace mgdd::engine {

/// Woschni's constant with pressure in bar and bore in m: 3.26 (kPa, m; Heywood 1988, eq. 12.6x) times 100^0.8.
inline constexpr double woschni_c1_bar_m = 129.8;
/// Hohenberg's constant with pressure in bar and volume in m3 (Hohenberg 1979).
inline constexpr double hohenberg_c1_bar_m3 = 130.0;

/// h = C1 B^-0.2 p^0.8 T^-0.55 w^0.8 (Woschni 1967; Tan 2018, eq. 2-5). The exponent -0.55 belongs to this C1.
template <class T>
T woschni_coefficient(const T& c1_bar_m, const T& bore_m, const T& pressure_bar, const T& temperature_k,
                      const T& gas_velocity_m_per_s) noexcept {
  using std::pow;
  return c1_bar_m * pow(bore_m, -0.2) * pow(pressure_bar, 0.8) * pow(temperature_k, -0.55) *
         pow(gas_velocity_m_per_s, 0.8);
}

/// w = C2 Sp + Cp (Vs T_ref)/(p_ref V_ref) max(0, p - p_mot) (Woschni 1967). Eq. 2-6 of Tan 2018 is cut after T_ref;
/// the factor Cp and the denominators are Woschni's.
template <class T>
T woschni_velocity(const T& c2, const T& cp_m_per_sk, const T& piston_speed_m_per_s, const T& swept_over_ref_volume,
                   const T& ref_temperature_k, const T& pressure_rise_over_ref) noexcept {
  T w = c2 * piston_speed_m_per_s;
  if (value_of(pressure_rise_over_ref) > 0.0) {
    w += cp_m_per_sk * swept_over_ref_volume * ref_temperature_k * pressure_rise_over_ref;
  }
  return w;
}

/// h = C1 V^-0.06 p^0.8 T^-0.4 (Sp + 1.4)^0.8 (Hohenberg 1979).
template <class T>
T hohenberg_coefficient(const T& c1_bar_m3, const T& volume_m3, const T& pressure_bar, const T& temperature_k,
                        const T& piston_speed_m_per_s) noexcept {
  using std::pow;
  return c1_bar_m3 * pow(volume_m3, -0.06) * pow(pressure_bar, 0.8) * pow(temperature_k, -0.4) *
         pow(piston_speed_m_per_s + 1.4, 0.8);
}

// w^0.8 as exp(0.8 ln w): cheaper than pow and equal to 2e-15 over any gas velocity.
inline double four_fifths_power(double w) noexcept { return std::exp(0.8 * std::log(w)); }
template <int N>
Dual<N> four_fifths_power(const Dual<N>& w) noexcept {
  const double y = four_fifths_power(w.value);
  return chain(y, 0.8 * y / w.value, w);
}

/// Wall heat of one cycle. With T = p V/(N R), Woschni's p^0.8 T^-0.55 is p^0.25 V^-0.55 (N R)^0.55 and Hohenberg's
/// p^0.8 T^-0.4 is p^0.4 V^-0.4 (N R)^0.4, so that the volume goes to a table and two square roots replace two powers.
template <class T>
class WallHeat {
 public:
  /// Volume part of h A dt for a step of `step_cad`: area times V^-0.55 (Woschni) or V^-0.46 (Hohenberg).
  static T volume_term(const BasicCylinder<T>& c, const Geometry<T>& g, const T& volume_m3, double step_cad) noexcept {
    using std::pow;
    return g.wall_area_m2(volume_m3) * pow(volume_m3, c.wall_heat_model == WallHeatModel::woschni ? -0.55 : -0.46) *
           step_cad;
  }

  /// `ref_pressure_pa` is p(IVC); `gas_j_per_k` is N R.
  WallHeat(const BasicCylinder<T>& c, const Geometry<T>& g, const T& ref_pressure_pa, const T& gas_j_per_k,
           const T& speed_rpm) noexcept
      : wall_k_(c.wall_temperature_k), per_reference_(1.0 / ref_pressure_pa) {
    using std::pow;
    const T piston_speed = g.mean_piston_speed_m_per_s(speed_rpm);
    const T per_cad = 1.0 / (units::cad_per_s_per_rpm * speed_rpm);
    const double bar = std::pow(units::pa_per_bar, -0.8);
    if (c.wall_heat_model == WallHeatModel::woschni) {
      still_ = c.woschni_c2 * piston_speed;
      // Cp Vs T_ref/(p_ref V_ref) (p - p_mot) with T_ref = p_ref V_ref/(N R).
      burning_ = c.woschni_cp_m_per_sk * g.swept_m3 * ref_pressure_pa / gas_j_per_k;
      still_power_ = four_fifths_power(still_);
      scale_ = c.wall_heat_scale * woschni_c1_bar_m * bar * pow(g.bore_m, -0.2) * pow(gas_j_per_k, 0.55) * per_cad;
    } else {
      scale_ = c.wall_heat_scale * hohenberg_c1_bar_m3 * bar * pow(gas_j_per_k, 0.4) * per_cad *
               four_fifths_power(piston_speed + 1.4);
    }
  }

  /// Heat lost in one step [J], positive from gas to wall. `motored_ratio` is p_mot / p_ref.
  template <bool Woschni>
  T step_j(const T& pressure_pa, const T& temperature_k, const T& volume_term, const T& motored_ratio,
           bool burning) const noexcept {
    using std::pow;
    using std::sqrt;
    const T lead = scale_ * volume_term * (temperature_k - wall_k_);
    if constexpr (Woschni) {
      const T film = lead * sqrt(sqrt(pressure_pa));
      if (burning) {
        const T rise = pressure_pa * per_reference_ - motored_ratio;
        if (value_of(rise) > 0.0) return film * four_fifths_power(still_ + burning_ * rise);
      }
      return film * still_power_;
    } else {
      return lead * pow(pressure_pa, 0.4);
    }
  }

 private:
  T scale_, wall_k_, per_reference_;
  T still_{}, burning_{}, still_power_{};
};

}  // namespace mgdd::engine
