// Heat from the gas to the wall: the film coefficients of Woschni 1967, Hohenberg 1979 and Eichelberg 1939 [W/(m2 K)],
// pressure in bar and lengths in m, and the same laws arranged for the step of a cycle, where most powers cancel.
// noexcept, no heap.
#pragma once

#include <cmath>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/fast_power.hpp"

namespace mgdd::engine {

/// Woschni's constant with pressure in bar and bore in m: 3.26 (kPa, m; Heywood 1988, chapter 12) times 100^0.8.
inline constexpr double woschni_c1_bar_m = 129.8;
/// Hohenberg's constant with pressure in bar and volume in m3 (Hohenberg 1979).
inline constexpr double hohenberg_c1_bar_m3 = 130.0;
/// Eichelberg's constant with pressure in bar: 7.67 (MPa; Eichelberg 1939) over the root of 10.
inline constexpr double eichelberg_c1_bar = 2.43;

/// h = C1 B^-0.2 p^0.8 T^-0.55 w^0.8 (Tan 2018, eq. 2-5; Heywood 1988, chapter 12). Woschni 1967 is quoted with -0.53
/// and the same constant: 15 % more at 1000 K.
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

/// h = C1 Sp^(1/3) p^0.5 T^0.5 (Eichelberg 1939).
template <class T>
T eichelberg_coefficient(const T& c1_bar, const T& pressure_bar, const T& temperature_k,
                         const T& piston_speed_m_per_s) noexcept {
  using std::pow;
  using std::sqrt;
  return c1_bar * pow(piston_speed_m_per_s, 1.0 / 3.0) * sqrt(pressure_bar * temperature_k);
}

// Both powers stand in the chain from one pressure to the next, where std::pow would be the longest link.
inline double four_fifths_power(double x) noexcept {
  return fast_power<4, 5>(x);
}
inline double two_fifths_power(double x) noexcept {
  return fast_power<2, 5>(x);
}
// At zero (C2 = 0 before the burn) the slope is infinite; zero there keeps every other derivative, which 0/0 would not.
template <int N>
Dual<N> four_fifths_power(const Dual<N>& x) noexcept {
  const double y = four_fifths_power(x.value);
  return chain(y, x.value > 0.0 ? 0.8 * y / x.value : 0.0, x);
}
template <int N>
Dual<N> two_fifths_power(const Dual<N>& x) noexcept {
  const double y = two_fifths_power(x.value);
  return chain(y, x.value > 0.0 ? 0.4 * y / x.value : 0.0, x);
}

/// Calls `with.operator()<model>()`, so that the loop of a cycle has no branch for the law.
template <class With>
void with_wall_heat(WallHeatModel model, const With& with) noexcept {
  switch (model) {
    case WallHeatModel::woschni:
      return with.template operator()<WallHeatModel::woschni>();
    case WallHeatModel::hohenberg:
      return with.template operator()<WallHeatModel::hohenberg>();
    case WallHeatModel::eichelberg:
      break;
  }
  with.template operator()<WallHeatModel::eichelberg>();
}

/// Wall heat of one cycle. With T = p V/(N R), Woschni's p^0.8 T^-0.55 is p^0.25 V^-0.55 (N R)^0.55 and Hohenberg's
/// p^0.8 T^-0.4 is p^0.4 V^-0.4 (N R)^0.4, so that the volume goes to a table and two square roots replace two powers;
/// Eichelberg's p^0.5 T^0.5 is p V^0.5 (N R)^-0.5, which needs no power at all.
template <class T>
class WallHeat {
 public:
  /// Volume part of h A dt for a step of `step_cad`: area times V^-0.55 (Woschni), V^-0.46 (Hohenberg) or V^0.5.
  static T volume_term(WallHeatModel model, const Geometry<T>& g, const T& volume_m3, double step_cad) noexcept {
    using std::pow;
    const double exponent = model == WallHeatModel::woschni ? -0.55 : model == WallHeatModel::hohenberg ? -0.46 : 0.5;
    return g.wall_area_m2(volume_m3) * pow(volume_m3, exponent) * step_cad;
  }

  /// What the cylinder alone fixes of the scale.
  static T lead(const WallHeatParameters<T>& c, const Geometry<T>& g) noexcept {
    using std::pow;
    const double bar = std::pow(units::pa_per_bar, -0.8);
    if (c.wall_heat_model == WallHeatModel::woschni)
      return c.wall_heat_scale * woschni_c1_bar_m * bar * pow(g.bore_m, -0.2);
    if (c.wall_heat_model == WallHeatModel::hohenberg) return c.wall_heat_scale * hohenberg_c1_bar_m3 * bar;
    return c.wall_heat_scale * eichelberg_c1_bar / std::sqrt(units::pa_per_bar);
  }

  /// `ref_pressure_pa` is p(IVC); `gas_j_per_k` is N R.
  WallHeat(const WallHeatParameters<T>& c, const Geometry<T>& g, const T& ref_pressure_pa, const T& gas_j_per_k,
           const T& speed_rpm) noexcept
      : WallHeat(c, g, ref_pressure_pa, gas_j_per_k, speed_rpm, lead(c, g)) {}
  WallHeat(const WallHeatParameters<T>& c, const Geometry<T>& g, const T& ref_pressure_pa, const T& gas_j_per_k,
           const T& speed_rpm, const T& lead) noexcept
      : wall_k_(c.wall_temperature_k) {
    using std::pow;
    const T piston_speed = g.mean_piston_speed_m_per_s(speed_rpm);
    const T per_cad = 1.0 / (units::cad_per_s_per_rpm * speed_rpm);
    if (c.wall_heat_model == WallHeatModel::woschni) {
      still_ = c.woschni_c2 * piston_speed;
      // Cp Vs T_ref/(p_ref V_ref) (p - p_mot) with T_ref = p_ref V_ref/(N R).
      burning_per_pa_ = c.woschni_cp_m_per_sk * g.swept_m3 / gas_j_per_k;
      burning_ = burning_per_pa_ * ref_pressure_pa;
      still_power_ = four_fifths_power(still_);
      scale_ = lead * pow(gas_j_per_k, 0.55) * per_cad;
    } else if (c.wall_heat_model == WallHeatModel::hohenberg) {
      scale_ = lead * pow(gas_j_per_k, 0.4) * per_cad * four_fifths_power(piston_speed + 1.4);
    } else {
      scale_ = lead * pow(gas_j_per_k, -0.5) * per_cad * pow(piston_speed, 1.0 / 3.0);
    }
  }

  /// The numbers of the law, for code that carries many cycles: the heat of a step is scale volume_term
  /// (T - wall_k) film; the film of Woschni is p^0.25 still_power, or p^0.25 w^0.8 while w = (still - burning
  /// motored_ratio) + burning_per_pa p exceeds still; that of Hohenberg p^0.4, of Eichelberg p.
  struct Constants {
    T scale, wall_k, still, burning, burning_per_pa, still_power;
  };
  Constants constants() const noexcept { return {scale_, wall_k_, still_, burning_, burning_per_pa_, still_power_}; }

  /// The heat of a step is `lead_j` times `film`: two factors, because the first is ready long before the second.
  T lead_j(const T& temperature_k, const T& volume_term) const noexcept {
    return scale_ * volume_term * (temperature_k - wall_k_);
  }

  /// p^0.25 w^0.8 (Woschni), p^0.4 (Hohenberg) or p (Eichelberg), as factors in the order in which they become known:
  /// the next pressure waits for the last one only.
  template <WallHeatModel Model>
  struct Film {
    T early, late;  // only Woschni has the early one
    T times(const T& factor) const noexcept {
      if constexpr (Model == WallHeatModel::woschni) {
        return factor * early * late;
      } else {
        return factor * late;
      }
    }
  };

  /// `motored_ratio` is p_mot / p_ref.
  template <WallHeatModel Model>
  Film<Model> film(const T& pressure_pa, const T& motored_ratio, bool burning) const noexcept {
    using std::sqrt;
    if constexpr (Model == WallHeatModel::woschni) {
      const T root = sqrt(sqrt(pressure_pa));
      if (burning) {
        // still + Cp Vs T_ref/(p_ref V_ref) (p - p_mot), the part without p first: it does not wait for the pressure.
        const T velocity = (still_ - burning_ * motored_ratio) + burning_per_pa_ * pressure_pa;
        if (velocity > still_) return {root, four_fifths_power(velocity)};
      }
      return {still_power_, root};
    } else if constexpr (Model == WallHeatModel::hohenberg) {
      return {{}, two_fifths_power(pressure_pa)};
    } else {
      return {{}, pressure_pa};
    }
  }

  /// Heat lost in one step [J], positive from gas to wall.
  template <WallHeatModel Model>
  T step_j(const T& pressure_pa, const T& temperature_k, const T& volume_term, const T& motored_ratio,
           bool burning) const noexcept {
    return film<Model>(pressure_pa, motored_ratio, burning).times(lead_j(temperature_k, volume_term));
  }

 private:
  T scale_, wall_k_;
  T still_{}, burning_{}, burning_per_pa_{}, still_power_{};
};

}  // namespace mgdd::engine
