// Parameters of one cylinder, as records that the laws take one by one, and of one operating point, in conventional
// units, checked by `validate`. Tables of fields give every number its flat name, unit and domain.
// Crank angles are degrees, firing TDC = 0, negative before (°CA aTDC). The scalar type T is double, or Dual<N> where
// sensitivities are wanted; the arithmetic of the core is SI and happens behind `cycle.hpp`.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

enum class GammaModel { constant, linear, polynomial };
enum class BurnShape { triangle, wiebe, double_wiebe };
enum class WallHeatModel { woschni, hohenberg, eichelberg };
enum class IgnitionModel { watson, wolfer, hardenberg_hase, polynomial };
enum class Integrator { trapezoid, split, tan2018_lagged, euler };

/// Defaults everywhere are the plausible light-duty diesel of the preset `puma_single`.
template <class T>
struct GeometryParameters {
  T bore_mm{86.0};
  T stroke_mm{86.0};
  T connecting_rod_mm{155.0};
  T compression_ratio{18.2};
  T ivc_cad{-140.0};        ///< intake valve closing, start of the simulated part
  T evo_cad{130.0};         ///< exhaust valve opening, end of the simulated part
  T bowl_area_factor{1.0};  ///< [-] piston and head area over two flat discs; redundant with the wall-heat scale

  bool operator==(const GeometryParameters&) const = default;
};

/// Charge, heat of the fuel, and ratio of specific heats. `gamma` also sets the motored reference pressure of Woschni
/// in every model.
template <class T>
struct GasParameters {
  T ivc_pressure_rise_kpa{0.0};           ///< p(IVC) above the intake pressure
  T volumetric_efficiency{0.90};          ///< [-] on swept volume at intake conditions (Tan 2018, eq. 2-3)
  T lower_heating_value_mj_per_kg{42.8};  ///< EN 590 diesel, range 42.5 to 43.2
  T gamma{1.37};                          ///< [-] constant (Tan 2018)
  T gamma_linear_300k{1.38};              ///< [-] Gatowski et al. 1984: 1.38 - 8e-5 (T - 300 K)
  T gamma_linear_slope_per_k{-8.0e-5};
  T gamma_polynomial_c0{1.338};  ///< [-] Brunt, Rai and Emtage 1998 (constants unverified)
  T gamma_polynomial_c1_per_k{-6.0e-5};
  T gamma_polynomial_c2_per_k2{1.0e-8};
  GammaModel gamma_model{GammaModel::constant};

  bool operator==(const GasParameters&) const = default;
};

template <class T>
struct WallHeatParameters {
  T wall_heat_scale{
      0.5};            ///< [-] C1 over that of the law: 129.8 (Woschni, bar and m), 130 (Hohenberg), 2.43 (Eichelberg)
  T woschni_c2{2.28};  ///< [-] weight of the mean piston speed (Woschni 1967)
  T woschni_cp_m_per_sk{3.24e-3};  ///< combustion term of the gas velocity (Woschni 1967)
  T wall_temperature_k{450.0};
  WallHeatModel wall_heat_model{WallHeatModel::woschni};

  bool operator==(const WallHeatParameters&) const = default;
};

/// The duration law is duration_ref (fuel / fuel_ref)^0.6 (speed / speed_ref)^0.3 unless the point says otherwise.
template <class T>
struct BurnParameters {
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
  BurnShape burn_shape{BurnShape::triangle};

  bool operator==(const BurnParameters&) const = default;
};

template <class T>
struct IgnitionParameters {
  T cetane_number{45.0};   ///< [-] for Hardenberg-Hase
  T ignition_c0_cad{4.0};  ///< polynomial: c0 + c1 SOI + c2 SOI^2
  T ignition_c1{0.0};      ///< [-]
  T ignition_c2_per_cad{0.0};
  IgnitionModel ignition_model{IgnitionModel::watson};

  bool operator==(const IgnitionParameters&) const = default;
};

template <class T>
struct BasicCylinder {
  GeometryParameters<T> geometry{};
  GasParameters<T> gas{};
  WallHeatParameters<T> wall_heat{};
  BurnParameters<T> burn{};
  IgnitionParameters<T> ignition{};

  bool operator==(const BasicCylinder&) const = default;
};

template <class T>
struct BasicOperatingPoint {
  T speed_rpm{1500.0};
  T fuel_mg{20.0};  ///< per cycle; 0 is a motored cycle
  T intake_pressure_kpa{150.0};
  T intake_temperature_k{313.0};
  std::optional<T> burn_duration_cad{};  ///< none: the cylinder's duration law
  std::optional<T> trapped_mass_g{};     ///< none: see `charge.hpp`
  std::optional<T> ivc_temperature_k{};  ///< of the charge; gives the trapped mass where that is not stated

  bool operator==(const BasicOperatingPoint&) const = default;
};

using Cylinder = BasicCylinder<double>;
using OperatingPoint = BasicOperatingPoint<double>;

/// Every number of a cylinder under its flat name, record by record.
template <class T>
constexpr auto cylinder_fields() {
  using C = BasicCylinder<T>;
  using G = GeometryParameters<T>;
  using Gas = GasParameters<T>;
  using W = WallHeatParameters<T>;
  using B = BurnParameters<T>;
  using I = IgnitionParameters<T>;
  return std::array{
      field<&C::geometry, &G::bore_mm>({"bore_mm", "mm", above(0.0, 2000.0), "cylinder bore"}),
      field<&C::geometry, &G::stroke_mm>({"stroke_mm", "mm", above(0.0, 4000.0), "piston stroke"}),
      field<&C::geometry, &G::connecting_rod_mm>(
          {"connecting_rod_mm", "mm", above(0.0, 8000.0), "connecting rod, eye to eye"}),
      field<&C::geometry, &G::compression_ratio>(
          {"compression_ratio", "-", above(1.0, 100.0), "geometric compression ratio"}),
      field<&C::geometry, &G::ivc_cad>({"ivc_cad", "°CA aTDC", closed(-180.0, 0.0), "intake valve closing"}),
      field<&C::geometry, &G::evo_cad>({"evo_cad", "°CA aTDC", above(0.0, 180.0), "exhaust valve opening"}),
      field<&C::geometry, &G::bowl_area_factor>(
          {"bowl_area_factor", "-", above(0.0, 5.0), "head and piston area over two flat discs"}),
      field<&C::gas, &Gas::ivc_pressure_rise_kpa>(
          {"ivc_pressure_rise_kpa", "kPa", closed(-500.0, 500.0), "p(IVC) above the intake pressure"}),
      field<&C::gas, &Gas::volumetric_efficiency>(
          {"volumetric_efficiency", "-", above(0.0, 2.0), "trapped over ideal charge at intake conditions"}),
      field<&C::gas, &Gas::lower_heating_value_mj_per_kg>(
          {"lower_heating_value_mj_per_kg", "MJ/kg", above(0.0, 150.0), "heat of the fuel"}),
      field<&C::gas, &Gas::gamma>({"gamma", "-", above(1.0, 1.7), "constant ratio of specific heats"}),
      field<&C::gas, &Gas::gamma_linear_300k>({"gamma_linear_300k", "-", above(1.0, 1.7), "linear gamma(T) at 300 K"}),
      field<&C::gas, &Gas::gamma_linear_slope_per_k>(
          {"gamma_linear_slope_per_k", "1/K", closed(-2e-4, 2e-4), "slope of linear gamma(T)"}),
      field<&C::gas, &Gas::gamma_polynomial_c0>(
          {"gamma_polynomial_c0", "-", above(1.0, 1.7), "polynomial gamma(T), constant"}),
      field<&C::gas, &Gas::gamma_polynomial_c1_per_k>(
          {"gamma_polynomial_c1_per_k", "1/K", closed(-2e-4, 2e-4), "polynomial gamma(T), linear term"}),
      field<&C::gas, &Gas::gamma_polynomial_c2_per_k2>(
          {"gamma_polynomial_c2_per_k2", "1/K^2", closed(-1e-6, 1e-6), "polynomial gamma(T), quadratic term"}),
      field<&C::wall_heat, &W::wall_heat_scale>(
          {"wall_heat_scale", "-", closed(0.0, 100.0), "wall heat over the textbook law (Woschni C1/129.8)"}),
      field<&C::wall_heat, &W::woschni_c2>({"woschni_c2", "-", closed(0.0, 50.0), "weight of the mean piston speed"}),
      field<&C::wall_heat, &W::woschni_cp_m_per_sk>(
          {"woschni_cp_m_per_sk", "m/(s K)", closed(0.0, 1.0), "combustion term of the gas velocity"}),
      field<&C::wall_heat, &W::wall_temperature_k>(
          {"wall_temperature_k", "K", above(0.0, 2000.0), "mean wall temperature"}),
      field<&C::burn, &B::burn_duration_ref_cad>(
          {"burn_duration_ref_cad", "°CA", above(0.0, 360.0), "burn duration at the reference point"}),
      field<&C::burn, &B::burn_fuel_ref_mg>({"burn_fuel_ref_mg", "mg", above(0.0, 1e5), "fuel of the reference point"}),
      field<&C::burn, &B::burn_speed_ref_rpm>(
          {"burn_speed_ref_rpm", "rpm", above(0.0, 1e5), "speed of the reference point"}),
      field<&C::burn, &B::burn_fuel_exponent>(
          {"burn_fuel_exponent", "-", closed(-5.0, 5.0), "duration law: exponent of fuel"}),
      field<&C::burn, &B::burn_speed_exponent>(
          {"burn_speed_exponent", "-", closed(-5.0, 5.0), "duration law: exponent of speed"}),
      field<&C::burn, &B::wiebe_a>({"wiebe_a", "-", above(0.0, 100.0), "Wiebe completeness"}),
      field<&C::burn, &B::wiebe_m>({"wiebe_m", "-", above(-0.5, 20.0), "Wiebe shape, exponent m + 1"}),
      field<&C::burn, &B::second_fraction>(
          {"second_fraction", "-", closed(0.0, 1.0), "share of the heat in the second Wiebe law"}),
      field<&C::burn, &B::second_delay_cad>(
          {"second_delay_cad", "°CA", closed(-60.0, 120.0), "start of the second Wiebe law after the first"}),
      field<&C::burn, &B::second_duration_cad>(
          {"second_duration_cad", "°CA", above(0.0, 360.0), "duration of the second Wiebe law"}),
      field<&C::burn, &B::second_wiebe_m>({"second_wiebe_m", "-", above(-0.5, 20.0), "shape of the second Wiebe law"}),
      field<&C::ignition, &I::cetane_number>({"cetane_number", "-", above(0.0, 120.0), "for Hardenberg-Hase"}),
      field<&C::ignition, &I::ignition_c0_cad>(
          {"ignition_c0_cad", "°CA", closed(-60.0, 60.0), "polynomial ignition delay, constant"}),
      field<&C::ignition, &I::ignition_c1>(
          {"ignition_c1", "-", closed(-0.99, 10.0), "polynomial ignition delay, linear term"}),
      field<&C::ignition, &I::ignition_c2_per_cad>(
          {"ignition_c2_per_cad", "1/°CA", closed(-1.0, 1.0), "polynomial ignition delay, quadratic term"}),
  };
}

template <class T>
constexpr auto operating_point_fields() {
  using P = BasicOperatingPoint<T>;
  return std::array{
      field<&P::speed_rpm>({"speed_rpm", "rpm", above(0.0, 3e4), "engine speed"}),
      field<&P::fuel_mg>({"fuel_mg", "mg", closed(0.0, 1e5), "fuel per cycle, 0 = motored"}),
      field<&P::intake_pressure_kpa>({"intake_pressure_kpa", "kPa", above(0.0, 2000.0), "intake pressure"}),
      field<&P::intake_temperature_k>({"intake_temperature_k", "K", above(0.0, 1000.0), "intake temperature"}),
  };
}

/// The optional fields of an operating point, with the same kind of record.
inline constexpr FieldInfo burn_duration_info{"burn_duration_cad", "°CA", above(0.0, 360.0),
                                              "burn duration; none = the duration law"};
inline constexpr FieldInfo trapped_mass_info{"trapped_mass_g", "g", above(0.0, 1e4),
                                             "trapped charge; none = from ivc_temperature_k or volumetric efficiency"};
inline constexpr FieldInfo ivc_temperature_info{
    "ivc_temperature_k", "K", above(0.0, 1500.0),
    "charge at IVC; none = volumetric efficiency, for a measured trace the intake temperature + 40 K"};

/// Everything that Python and the files show of them.
constexpr auto fields_of(const Cylinder&) {
  using C = Cylinder;
  return std::tuple{
      cylinder_fields<double>(), field<&C::burn, &BurnParameters<double>::burn_shape>("burn_shape", "burn law"),
      field<&C::gas, &GasParameters<double>::gamma_model>("gamma_model", "gamma against T"),
      field<&C::wall_heat, &WallHeatParameters<double>::wall_heat_model>("wall_heat_model", "wall-heat correlation"),
      field<&C::ignition, &IgnitionParameters<double>::ignition_model>("ignition_model", "ignition-delay correlation")};
}
constexpr auto fields_of(const OperatingPoint&) {
  using P = OperatingPoint;
  return std::tuple{operating_point_fields<double>(), field<&P::burn_duration_cad>(burn_duration_info),
                    field<&P::trapped_mass_g>(trapped_mass_info), field<&P::ivc_temperature_k>(ivc_temperature_info)};
}

/// Throws ParameterError naming the first field outside its domain, its value and the bound.
void validate(const Cylinder& cylinder);
void validate(const OperatingPoint& point);

/// Timing inputs must lie in [-60, 20] °CA aTDC and inside the closed part; later ones look like °bTDC.
void validate_timing(std::string_view name, double value_cad, const Cylinder& cylinder);

inline constexpr double timing_lower_cad = -60.0;
inline constexpr double timing_upper_cad = 20.0;

/// Names of the variants as the field types them, and back; an unknown name is a ParameterError listing the valid ones.

/// Copies a cylinder or a point into another scalar type (constants, no derivative).
template <class T>
BasicCylinder<T> lift(const Cylinder& from) {
  BasicCylinder<T> to;
  constexpr auto source = cylinder_fields<double>();
  constexpr auto target = cylinder_fields<T>();
  for (std::size_t i = 0; i < source.size(); ++i)
    target[i].in(to) = T(source[i].in(from));
  to.burn.burn_shape = from.burn.burn_shape;
  to.gas.gamma_model = from.gas.gamma_model;
  to.wall_heat.wall_heat_model = from.wall_heat.wall_heat_model;
  to.ignition.ignition_model = from.ignition.ignition_model;
  return to;
}
template <class T>
BasicOperatingPoint<T> lift(const OperatingPoint& from) {
  BasicOperatingPoint<T> to;
  constexpr auto source = operating_point_fields<double>();
  constexpr auto target = operating_point_fields<T>();
  for (std::size_t i = 0; i < source.size(); ++i)
    target[i].in(to) = T(source[i].in(from));
  if (from.burn_duration_cad) to.burn_duration_cad = T(*from.burn_duration_cad);
  if (from.trapped_mass_g) to.trapped_mass_g = T(*from.trapped_mass_g);
  if (from.ivc_temperature_k) to.ivc_temperature_k = T(*from.ivc_temperature_k);
  return to;
}

/// Burn duration in force: the point's own, or duration_ref (fuel/fuel_ref)^e1 (speed/speed_ref)^e2.
template <class T>
T burn_duration_cad(const BurnParameters<T>& b, const BasicOperatingPoint<T>& point) noexcept {
  using std::pow;
  if (point.burn_duration_cad) return *point.burn_duration_cad;
  if (!(value_of(point.fuel_mg) > 0.0)) return b.burn_duration_ref_cad;
  return b.burn_duration_ref_cad * pow(point.fuel_mg / b.burn_fuel_ref_mg, b.burn_fuel_exponent) *
         pow(point.speed_rpm / b.burn_speed_ref_rpm, b.burn_speed_exponent);
}

/// Heat of the injected fuel [J].
template <class T>
T fuel_heat_j(const GasParameters<T>& g, const BasicOperatingPoint<T>& point) noexcept {
  return point.fuel_mg * g.lower_heating_value_mj_per_kg;
}

}  // namespace mgdd::engine
