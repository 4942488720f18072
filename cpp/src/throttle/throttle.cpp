#include "mgdd/throttle/throttle.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::throttle {
namespace {

constexpr double most = 1e300;  // finite, so that infinity itself is refused

using T = Throttle;
constexpr std::array field_table{
    Field{{"inertia_kgm2", "kg m²", 0.0, true, 1.0, "inertia of plate, gears and motor at the plate"},
          &T::inertia_kgm2},
    Field{{"viscous_nms_per_rad", "N m s/rad", 0.0, false, 100.0, "viscous friction"}, &T::viscous_nms_per_rad},
    Field{{"torque_constant_nm_per_a", "N m/A", 0.0, true, 100.0, "motor torque per current at the plate"},
          &T::torque_constant_nm_per_a},
    Field{{"back_emf_vs_per_rad", "V s/rad", 0.0, false, 100.0, "motor voltage per plate speed"},
          &T::back_emf_vs_per_rad},
    Field{{"resistance_ohm", "ohm", 0.0, true, 1e4, "armature resistance"}, &T::resistance_ohm},
    Field{{"inductance_mh", "mH", 0.0, false, 1e4, "armature inductance"}, &T::inductance_mh},
    Field{{"supply_v", "V", 0.0, true, 100.0, "supply of the bridge"}, &T::supply_v},
    Field{{"driver_drop_v", "V", 0.0, false, 100.0, "voltage lost in the bridge at full duty"}, &T::driver_drop_v},
    Field{{"driver_resistance_ohm", "ohm", 0.0, false, 1e4, "resistance of the bridge"}, &T::driver_resistance_ohm},
    Field{{"dead_band", "-", 0.0, false, 0.9, "duty without effect on either side of zero"}, &T::dead_band},
    Field{{"coulomb_nm", "N m", 0.0, false, 100.0, "Coulomb friction"}, &T::coulomb_nm},
    Field{{"stiction_nm", "N m", 0.0, false, 100.0, "breakaway friction"}, &T::stiction_nm},
    Field{{"stribeck_rad_per_s", "rad/s", 0.0, true, 1e3, "speed of the Stribeck curve"}, &T::stribeck_rad_per_s},
    Field{{"karnopp_rad_per_s", "rad/s", 0.0, true, 1e3, "half band of rest of Karnopp's form"}, &T::karnopp_rad_per_s},
    Field{{"tanh_rad_per_s", "rad/s", 0.0, true, 1e3, "width of the smooth form"}, &T::tanh_rad_per_s},
    Field{{"bristle_nm_per_rad", "N m/rad", 0.0, true, 1e6, "LuGre bristle stiffness"}, &T::bristle_nm_per_rad},
    Field{{"bristle_damping_nms_per_rad", "N m s/rad", 0.0, false, 1e3, "LuGre bristle damping"},
          &T::bristle_damping_nms_per_rad},
    Field{{"limp_home_deg", "deg", -360.0, false, 360.0, "rest angle without current"}, &T::limp_home_deg},
    Field{{"spring_above_nm_per_rad", "N m/rad", 0.0, false, 1e4, "spring above limp-home"},
          &T::spring_above_nm_per_rad},
    Field{{"spring_below_nm_per_rad", "N m/rad", 0.0, false, 1e4, "spring below limp-home"},
          &T::spring_below_nm_per_rad},
    Field{{"preload_above_nm", "N m", 0.0, false, 100.0, "preload above limp-home"}, &T::preload_above_nm},
    Field{{"preload_below_nm", "N m", 0.0, false, 100.0, "preload below limp-home"}, &T::preload_below_nm},
    Field{{"preload_ramp_deg", "deg", 0.0, true, 45.0, "half width over which the preload changes sign"},
          &T::preload_ramp_deg},
    Field{{"closed_deg", "deg", -360.0, false, 360.0, "lower end stop"}, &T::closed_deg},
    Field{{"open_deg", "deg", -360.0, false, 360.0, "upper end stop"}, &T::open_deg},
    Field{{"stop_stiffness_nm_per_rad", "N m/rad", 0.0, true, 1e7, "stiffness of the end stops"},
          &T::stop_stiffness_nm_per_rad},
    Field{{"stop_damping_nms_per_rad", "N m s/rad", 0.0, false, 1e5, "damping of the end stops"},
          &T::stop_damping_nms_per_rad},
    Field{{"backlash_half_deg", "deg", 0.0, true, 10.0, "half gap of the gear"}, &T::backlash_half_deg},
    Field{{"gear_stiffness_nm_per_rad", "N m/rad", 0.0, true, 1e6, "contact stiffness of the gear"},
          &T::gear_stiffness_nm_per_rad},
    Field{{"gear_damping_nms_per_rad", "N m s/rad", 0.0, false, 1e3, "contact damping of the gear"},
          &T::gear_damping_nms_per_rad},
    Field{{"plate_inertia_kgm2", "kg m²", 0.0, true, 1.0, "inertia on the plate's side of the gap"},
          &T::plate_inertia_kgm2},
    Field{{"plate_friction_share", "-", 0.0, false, 1.0, "share of the friction on the plate's side of the gap"},
          &T::plate_friction_share},
    Field{{"bore_mm", "mm", 0.0, true, 1e3, "bore of the throttle"}, &T::bore_mm},
    Field{{"pressure_drop_kpa", "kPa", 0.0, false, 200.0, "pressure drop that loads the plate"}, &T::pressure_drop_kpa},
};

constexpr std::pair<Friction, std::string_view> friction_table[] = {
    {Friction::coulomb, "coulomb"}, {Friction::stiction, "stiction"}, {Friction::stribeck, "stribeck"},
    {Friction::karnopp, "karnopp"}, {Friction::tanh, "tanh"},         {Friction::lugre, "lugre"}};
constexpr std::pair<Backlash, std::string_view> backlash_table[] = {
    {Backlash::none, "none"}, {Backlash::compliance, "compliance"}, {Backlash::hysteresis, "hysteresis"}};
constexpr std::pair<Bridge, std::string_view> bridge_table[] = {{Bridge::brake, "brake"}, {Bridge::open, "open"}};

std::string with_unit(const FieldInfo& info, double value) {
  std::string given = std::string(info.name) + " = " + text(value);
  if (info.unit != "-") given.append(" ").append(info.unit);
  return given;
}

void check(const FieldInfo& info, double value) {
  const bool above = info.lower_open ? value > info.lower : value >= info.lower;
  if (above && value <= info.upper) return;  // NaN fails both comparisons
  std::string message = with_unit(info, value) + ": must be " + (info.lower_open ? "> " : ">= ") + text(info.lower);
  if (info.upper < most) message += " and <= " + text(info.upper);
  throw ParameterError(message);
}

// Shape of the closing torque over the opening: largest near 75 deg, none closed or wide open.
constexpr std::array<double, 11> air_angle_deg{0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 75.0, 80.0, 90.0};
constexpr std::array<double, 11> air_coefficient{0.0,   0.003, 0.008, 0.015, 0.025, 0.040,
                                                 0.060, 0.080, 0.085, 0.070, 0.0};

}  // namespace

std::span<const Field> fields() noexcept {
  return field_table;
}
Names<Friction> friction_names() noexcept {
  return friction_table;
}
Names<Backlash> backlash_names() noexcept {
  return backlash_table;
}
Names<Bridge> bridge_names() noexcept {
  return bridge_table;
}

void validate(const Throttle& t) {
  for (const Field& field : field_table)
    check(field.info, t.*(field.member));
  if (!(t.closed_deg < t.open_deg)) {
    throw ParameterError("open_deg = " + text(t.open_deg) + " deg: must be above closed_deg = " + text(t.closed_deg));
  }
  if (!(t.limp_home_deg >= t.closed_deg && t.limp_home_deg <= t.open_deg)) {
    throw ParameterError("limp_home_deg = " + text(t.limp_home_deg) + " deg: must lie between closed_deg = " +
                         text(t.closed_deg) + " and open_deg = " + text(t.open_deg));
  }
  if (t.friction != Friction::coulomb && t.friction != Friction::tanh && !(t.stiction_nm >= t.coulomb_nm)) {
    throw ParameterError("stiction_nm = " + text(t.stiction_nm) +
                         " N m: must be >= coulomb_nm = " + text(t.coulomb_nm) + " for friction = '" +
                         std::string(name_of(friction_names(), t.friction)) + "'");
  }
  if (t.friction == Friction::lugre && !(t.coulomb_nm > 0.0)) {
    throw ParameterError("coulomb_nm = " + text(t.coulomb_nm) + " N m: must be > 0 for friction = 'lugre'");
  }
  if (!(t.driver_drop_v < t.supply_v)) {
    throw ParameterError("driver_drop_v = " + text(t.driver_drop_v) +
                         " V: must be below supply_v = " + text(t.supply_v));
  }
  if (t.backlash == Backlash::compliance && !(t.plate_inertia_kgm2 < t.inertia_kgm2)) {
    throw ParameterError("plate_inertia_kgm2 = " + text(t.plate_inertia_kgm2) +
                         " kg m²: must be below inertia_kgm2 = " + text(t.inertia_kgm2) + ", of which it is a part");
  }
}

AirflowPoint airflow_point(double angle_deg) noexcept {
  if (!(angle_deg > air_angle_deg.front() && angle_deg < air_angle_deg.back())) return {0.0, 0.0};
  std::size_t i = 1;
  while (air_angle_deg[i] < angle_deg)
    ++i;
  const double width = air_angle_deg[i] - air_angle_deg[i - 1];
  const double share = (angle_deg - air_angle_deg[i - 1]) / width;
  const double rise = air_coefficient[i] - air_coefficient[i - 1];
  return {air_coefficient[i - 1] + share * rise, rise / width};
}

double airflow_coefficient(double angle_deg) noexcept {
  return airflow_point(angle_deg).coefficient;
}

double airflow_torque_nm(const Throttle& t, double angle_deg) noexcept {
  const double bore_m = t.bore_mm * units::m_per_mm;
  return -bore_m * bore_m * bore_m * t.pressure_drop_kpa * units::pa_per_kpa * airflow_coefficient(angle_deg);
}

}  // namespace mgdd::throttle
