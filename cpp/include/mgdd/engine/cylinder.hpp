// Parameters of one cylinder and of one operating point: flat structs in the units of the field, checked by `validate`.
// Crank angles are degrees, firing TDC = 0, negative before (°CA aTDC). The scalar type T is double, or Dual<N> where
// sensitivities are wanted; the arithmetic of the core is SI and happens behind `cycle.hpp`.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

enum class GammaModel { constant, linear, polynomial };
enum class BurnShape { triangle, wiebe, double_wiebe };
enum class WallHeatModel { woschni, hohenberg };
enum class IgnitionModel { watson, wolfer, hardenberg_hase, polynomial };
enum class Integrator { trapezoid, split, seed, euler };

template <class T>
struct BasicCylinder {
  // Geometry. Defaults are the plausible light-duty diesel of the preset `puma_single`.
  T bore_mm{86.0};
  T stroke_mm{86.0};
  T connecting_rod_mm{155.0};
  T compression_ratio{18.2};
  T ivc_cad{-140.0};             ///< intake valve closing, start of the simulated part
  T evo_cad{130.0};              ///< exhaust valve opening, end of the simulated part
  T bowl_area_factor{1.0};       ///< [-] piston and head area over two flat discs; redundant with the wall-heat scale
  T ivc_pressure_rise_kpa{0.0};  ///< p(IVC) above the intake pressure

  // Charge and fuel.
  T volumetric_efficiency{0.90};          ///< [-] on swept volume at intake conditions (Tan 2018, eq. 2-3)
  T lower_heating_value_mj_per_kg{42.8};  ///< EN 590 diesel, range 42.5 to 43.2

  // Ratio of specific heats. `gamma` also sets the motored reference pressure of Woschni in every model.
  T gamma{1.37};              ///< [-] constant (Tan 2018)
  T gamma_linear_300k{1.38};  ///< [-] Gatowski et al. 1984: 1.38 - 8e-5 (T - 300 K)
  T gamma_linear_slope_per_k{-8.0e-5};
  T gamma_polynomial_c0{1.338};  ///< [-] Brunt, Rai and Emtage 1998 (constants unverified)
  T gamma_polynomial_c1_per_k{-6.0e-5};
  T gamma_polynomial_c2_per_k2{1.0e-8};

  // Wall heat.
  T wall_heat_scale{0.5};          ///< [-] C1 / 129.8 (Woschni, bar and m) or the factor on 130 (Hohenberg)
  T woschni_c2{2.28};              ///< [-] weight of the mean piston speed (Woschni 1967)
  T woschni_cp_m_per_sk{3.24e-3};  ///< combustion term of the gas velocity (Woschni 1967)
  T wall_temperature_k{450.0};

  // Burn. The duration law is duration_ref (fuel / fuel_ref)^0.6 (speed / speed_ref)^0.3 unless the point says
  // otherwise.
  T burn_duration_ref_cad{30.0};
  T burn_fuel_ref_mg{20.0};
  T burn_speed_ref_rpm{1500.0};
  T burn_fuel_exponent{0.6};
  T burn_speed_exponent{0.3};
  T wiebe_a{6.908};         ///< [-] 99.9 % burned at the end, before renormalisation
  T wiebe_m{1.5};           ///< [-] shape; the exponent is m + 1
  T second_fraction{0.6};   ///< [-] share of the heat in the second Wiebe law
  T second_delay_cad{3.0};  ///< start of the second law after the first
  T second_duration_cad{50.0};
  T second_wiebe_m{0.8};

  // Ignition delay.
  T cetane_number{45.0};   ///< [-] for Hardenberg-Hase
  T ignition_c0_cad{4.0};  ///< polynomial: c0 + c1 SOI + c2 SOI^2
  T ignition_c1{0.0};      ///< [-]
  T ignition_c2_per_cad{0.0};

  BurnShape burn_shape{BurnShape::triangle};
  GammaModel gamma_model{GammaModel::constant};
  WallHeatModel wall_heat_model{WallHeatModel::woschni};
  IgnitionModel ignition_model{IgnitionModel::watson};

  bool operator==(const BasicCylinder&) const = default;
};

template <class T>
struct BasicOperatingPoint {
  T speed_rpm{1500.0};
  T fuel_mg{20.0};  ///< per cycle; 0 is a motored cycle
  T intake_pressure_kpa{150.0};
  T intake_temperature_k{313.0};
  std::optional<T> burn_duration_cad{};  ///< none: the cylinder's duration law
  std::optional<T> trapped_mass_g{};     ///< none: volumetric efficiency (Tan 2018, eq. 2-3)

  bool operator==(const BasicOperatingPoint&) const = default;
};

using Cylinder = BasicCylinder<double>;
using OperatingPoint = BasicOperatingPoint<double>;

/// What a field is: its name and unit, its domain [lower, upper] (open where said) and its meaning.
struct FieldInfo {
  std::string_view name;
  std::string_view unit;
  double lower;
  bool lower_open;
  double upper;
  std::string_view meaning;
};

template <class Owner, class T>
struct Field {
  FieldInfo info;
  T Owner::* member;
};

inline constexpr double unbounded = 1e300;  // finite, so that infinity itself is refused by the bound

template <class T>
constexpr auto cylinder_fields() {
  using C = BasicCylinder<T>;
  using F = Field<C, T>;
  return std::array{
      F{{"bore_mm", "mm", 0.0, true, 2000.0, "cylinder bore"}, &C::bore_mm},
      F{{"stroke_mm", "mm", 0.0, true, 4000.0, "piston stroke"}, &C::stroke_mm},
      F{{"connecting_rod_mm", "mm", 0.0, true, 8000.0, "connecting rod, eye to eye"}, &C::connecting_rod_mm},
      F{{"compression_ratio", "-", 1.0, true, 100.0, "geometric compression ratio"}, &C::compression_ratio},
      F{{"ivc_cad", "°CA aTDC", -180.0, false, 0.0, "intake valve closing"}, &C::ivc_cad},
      F{{"evo_cad", "°CA aTDC", 0.0, true, 180.0, "exhaust valve opening"}, &C::evo_cad},
      F{{"bowl_area_factor", "-", 0.0, true, 5.0, "head and piston area over two flat discs"}, &C::bowl_area_factor},
      F{{"ivc_pressure_rise_kpa", "kPa", -500.0, false, 500.0, "p(IVC) above the intake pressure"},
        &C::ivc_pressure_rise_kpa},
      F{{"volumetric_efficiency", "-", 0.0, true, 2.0, "trapped over ideal charge at intake conditions"},
        &C::volumetric_efficiency},
      F{{"lower_heating_value_mj_per_kg", "MJ/kg", 0.0, true, 150.0, "heat of the fuel"},
        &C::lower_heating_value_mj_per_kg},
      F{{"gamma", "-", 1.0, true, 1.7, "constant ratio of specific heats"}, &C::gamma},
      F{{"gamma_linear_300k", "-", 1.0, true, 1.7, "linear gamma(T) at 300 K"}, &C::gamma_linear_300k},
      F{{"gamma_linear_slope_per_k", "1/K", -2e-4, false, 2e-4, "slope of linear gamma(T)"},
        &C::gamma_linear_slope_per_k},
      F{{"gamma_polynomial_c0", "-", 1.0, true, 1.7, "polynomial gamma(T), constant"}, &C::gamma_polynomial_c0},
      F{{"gamma_polynomial_c1_per_k", "1/K", -2e-4, false, 2e-4, "polynomial gamma(T), linear term"},
        &C::gamma_polynomial_c1_per_k},
      F{{"gamma_polynomial_c2_per_k2", "1/K^2", -1e-6, false, 1e-6, "polynomial gamma(T), quadratic term"},
        &C::gamma_polynomial_c2_per_k2},
      F{{"wall_heat_scale", "-", 0.0, false, 100.0, "wall heat over the textbook law (Woschni C1/129.8)"},
        &C::wall_heat_scale},
      F{{"woschni_c2", "-", 0.0, false, 50.0, "weight of the mean piston speed"}, &C::woschni_c2},
      F{{"woschni_cp_m_per_sk", "m/(s K)", 0.0, false, 1.0, "combustion term of the gas velocity"},
        &C::woschni_cp_m_per_sk},
      F{{"wall_temperature_k", "K", 0.0, true, 2000.0, "mean wall temperature"}, &C::wall_temperature_k},
      F{{"burn_duration_ref_cad", "°CA", 0.0, true, 360.0, "burn duration at the reference point"},
        &C::burn_duration_ref_cad},
      F{{"burn_fuel_ref_mg", "mg", 0.0, true, 1e5, "fuel of the reference point"}, &C::burn_fuel_ref_mg},
      F{{"burn_speed_ref_rpm", "rpm", 0.0, true, 1e5, "speed of the reference point"}, &C::burn_speed_ref_rpm},
      F{{"burn_fuel_exponent", "-", -5.0, false, 5.0, "duration law: exponent of fuel"}, &C::burn_fuel_exponent},
      F{{"burn_speed_exponent", "-", -5.0, false, 5.0, "duration law: exponent of speed"}, &C::burn_speed_exponent},
      F{{"wiebe_a", "-", 0.0, true, 100.0, "Wiebe completeness"}, &C::wiebe_a},
      F{{"wiebe_m", "-", -0.5, true, 20.0, "Wiebe shape, exponent m + 1"}, &C::wiebe_m},
      F{{"second_fraction", "-", 0.0, false, 1.0, "share of the heat in the second Wiebe law"}, &C::second_fraction},
      F{{"second_delay_cad", "°CA", -60.0, false, 120.0, "start of the second Wiebe law after the first"},
        &C::second_delay_cad},
      F{{"second_duration_cad", "°CA", 0.0, true, 360.0, "duration of the second Wiebe law"}, &C::second_duration_cad},
      F{{"second_wiebe_m", "-", -0.5, true, 20.0, "shape of the second Wiebe law"}, &C::second_wiebe_m},
      F{{"cetane_number", "-", 0.0, true, 120.0, "for Hardenberg-Hase"}, &C::cetane_number},
      F{{"ignition_c0_cad", "°CA", -60.0, false, 60.0, "polynomial ignition delay, constant"}, &C::ignition_c0_cad},
      F{{"ignition_c1", "-", -0.99, false, 10.0, "polynomial ignition delay, linear term"}, &C::ignition_c1},
      F{{"ignition_c2_per_cad", "1/°CA", -1.0, false, 1.0, "polynomial ignition delay, quadratic term"},
        &C::ignition_c2_per_cad},
  };
}

template <class T>
constexpr auto operating_point_fields() {
  using P = BasicOperatingPoint<T>;
  using F = Field<P, T>;
  return std::array{
      F{{"speed_rpm", "rpm", 0.0, true, 3e4, "engine speed"}, &P::speed_rpm},
      F{{"fuel_mg", "mg", 0.0, false, 1e5, "fuel per cycle, 0 = motored"}, &P::fuel_mg},
      F{{"intake_pressure_kpa", "kPa", 0.0, true, 2000.0, "intake pressure"}, &P::intake_pressure_kpa},
      F{{"intake_temperature_k", "K", 0.0, true, 1000.0, "intake temperature"}, &P::intake_temperature_k},
  };
}

/// The two optional fields of an operating point, with the same kind of record.
inline constexpr FieldInfo burn_duration_info{
    "burn_duration_cad", "°CA", 0.0, true, 360.0, "burn duration; none = the duration law"};
inline constexpr FieldInfo trapped_mass_info{
    "trapped_mass_g", "g", 0.0, true, 1e4, "trapped charge; none = volumetric efficiency"};

/// Throws ParameterError naming the first field outside its domain, its value and the bound.
void validate(const Cylinder& cylinder);
void validate(const OperatingPoint& point);

/// Timing inputs must lie in [-60, 20] °CA aTDC and inside the closed part; later ones look like °bTDC.
void validate_timing(std::string_view name, double value_cad, const Cylinder& cylinder);

inline constexpr double timing_lower_cad = -60.0;
inline constexpr double timing_upper_cad = 20.0;

/// Names of the variants as the field types them, and back; an unknown name is a ParameterError listing the valid ones.
std::string_view to_string(GammaModel v) noexcept;
std::string_view to_string(BurnShape v) noexcept;
std::string_view to_string(WallHeatModel v) noexcept;
std::string_view to_string(IgnitionModel v) noexcept;
std::string_view to_string(Integrator v) noexcept;
GammaModel parse_gamma_model(std::string_view name);
BurnShape parse_burn_shape(std::string_view name);
WallHeatModel parse_wall_heat_model(std::string_view name);
IgnitionModel parse_ignition_model(std::string_view name);
Integrator parse_integrator(std::string_view name);

/// Copies a cylinder or a point into another scalar type (constants, no derivative).
template <class T>
BasicCylinder<T> lift(const Cylinder& from) {
  BasicCylinder<T> to;
  constexpr auto source = cylinder_fields<double>();
  constexpr auto target = cylinder_fields<T>();
  for (std::size_t i = 0; i < source.size(); ++i)
    to.*(target[i].member) = T(from.*(source[i].member));
  to.burn_shape = from.burn_shape;
  to.gamma_model = from.gamma_model;
  to.wall_heat_model = from.wall_heat_model;
  to.ignition_model = from.ignition_model;
  return to;
}
template <class T>
BasicOperatingPoint<T> lift(const OperatingPoint& from) {
  BasicOperatingPoint<T> to;
  constexpr auto source = operating_point_fields<double>();
  constexpr auto target = operating_point_fields<T>();
  for (std::size_t i = 0; i < source.size(); ++i)
    to.*(target[i].member) = T(from.*(source[i].member));
  if (from.burn_duration_cad) to.burn_duration_cad = T(*from.burn_duration_cad);
  if (from.trapped_mass_g) to.trapped_mass_g = T(*from.trapped_mass_g);
  return to;
}

/// Burn duration in force: the point's own, or duration_ref (fuel/fuel_ref)^e1 (speed/speed_ref)^e2.
template <class T>
T burn_duration_cad(const BasicCylinder<T>& c, const BasicOperatingPoint<T>& point) noexcept {
  using std::pow;
  if (point.burn_duration_cad) return *point.burn_duration_cad;
  if (!(value_of(point.fuel_mg) > 0.0)) return c.burn_duration_ref_cad;
  return c.burn_duration_ref_cad * pow(point.fuel_mg / c.burn_fuel_ref_mg, c.burn_fuel_exponent) *
         pow(point.speed_rpm / c.burn_speed_ref_rpm, c.burn_speed_exponent);
}

/// Heat of the injected fuel [J].
template <class T>
T fuel_heat_j(const BasicCylinder<T>& c, const BasicOperatingPoint<T>& point) noexcept {
  return point.fuel_mg * c.lower_heating_value_mj_per_kg;
}

}  // namespace mgdd::engine
