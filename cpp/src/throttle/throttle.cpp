#include "mgdd/throttle/throttle.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::throttle {
namespace {

using T = Throttle;
constexpr std::array field_table{
    field<&T::inertia_kgm2>(
        {"inertia_kgm2", "kg m²", above(0.0, 1.0), "inertia of plate, gears and motor at the plate"}),
    field<&T::viscous_nms_per_rad>({"viscous_nms_per_rad", "N m s/rad", closed(0.0, 100.0), "viscous friction"}),
    field<&T::torque_constant_nm_per_a>(
        {"torque_constant_nm_per_a", "N m/A", above(0.0, 100.0), "motor torque per current at the plate"}),
    field<&T::back_emf_vs_per_rad>(
        {"back_emf_vs_per_rad", "V s/rad", closed(0.0, 100.0), "motor voltage per plate speed"}),
    field<&T::resistance_ohm>({"resistance_ohm", "ohm", above(0.0, 1e4), "armature resistance"}),
    field<&T::inductance_mh>({"inductance_mh", "mH", closed(0.0, 1e4), "armature inductance"}),
    field<&T::supply_v>({"supply_v", "V", above(0.0, 100.0), "supply of the bridge"}),
    field<&T::driver_drop_v>({"driver_drop_v", "V", closed(0.0, 100.0), "voltage lost in the bridge at full duty"}),
    field<&T::driver_resistance_ohm>({"driver_resistance_ohm", "ohm", closed(0.0, 1e4), "resistance of the bridge"}),
    field<&T::dead_band>({"dead_band", "-", closed(0.0, 0.9), "duty without effect on either side of zero"}),
    field<&T::coulomb_nm>({"coulomb_nm", "N m", closed(0.0, 100.0), "Coulomb friction"}),
    field<&T::stiction_nm>({"stiction_nm", "N m", closed(0.0, 100.0), "breakaway friction"}),
    field<&T::stribeck_rad_per_s>({"stribeck_rad_per_s", "rad/s", above(0.0, 1e3), "speed of the Stribeck curve"}),
    field<&T::karnopp_rad_per_s>(
        {"karnopp_rad_per_s", "rad/s", above(0.0, 1e3), "half band of rest of Karnopp's form"}),
    field<&T::tanh_rad_per_s>({"tanh_rad_per_s", "rad/s", above(0.0, 1e3), "width of the smooth form"}),
    field<&T::bristle_nm_per_rad>({"bristle_nm_per_rad", "N m/rad", above(0.0, 1e6), "LuGre bristle stiffness"}),
    field<&T::bristle_damping_nms_per_rad>(
        {"bristle_damping_nms_per_rad", "N m s/rad", closed(0.0, 1e3), "LuGre bristle damping"}),
    field<&T::limp_home_deg>({"limp_home_deg", "deg", closed(-360.0, 360.0), "rest angle without current"}),
    field<&T::spring_above_nm_per_rad>(
        {"spring_above_nm_per_rad", "N m/rad", closed(0.0, 1e4), "spring above limp-home"}),
    field<&T::spring_below_nm_per_rad>(
        {"spring_below_nm_per_rad", "N m/rad", closed(0.0, 1e4), "spring below limp-home"}),
    field<&T::preload_above_nm>({"preload_above_nm", "N m", closed(0.0, 100.0), "preload above limp-home"}),
    field<&T::preload_below_nm>({"preload_below_nm", "N m", closed(0.0, 100.0), "preload below limp-home"}),
    field<&T::preload_ramp_deg>(
        {"preload_ramp_deg", "deg", above(0.0, 45.0), "half width over which the preload changes sign"}),
    field<&T::closed_deg>({"closed_deg", "deg", closed(-360.0, 360.0), "lower end stop"}),
    field<&T::open_deg>({"open_deg", "deg", closed(-360.0, 360.0), "upper end stop"}),
    field<&T::stop_stiffness_nm_per_rad>(
        {"stop_stiffness_nm_per_rad", "N m/rad", above(0.0, 1e7), "stiffness of the end stops"}),
    field<&T::stop_damping_nms_per_rad>(
        {"stop_damping_nms_per_rad", "N m s/rad", closed(0.0, 1e5), "damping of the end stops"}),
    field<&T::backlash_half_deg>({"backlash_half_deg", "deg", above(0.0, 10.0), "half gap of the gear"}),
    field<&T::gear_stiffness_nm_per_rad>(
        {"gear_stiffness_nm_per_rad", "N m/rad", above(0.0, 1e6), "contact stiffness of the gear"}),
    field<&T::gear_damping_nms_per_rad>(
        {"gear_damping_nms_per_rad", "N m s/rad", closed(0.0, 1e3), "contact damping of the gear"}),
    field<&T::plate_inertia_kgm2>(
        {"plate_inertia_kgm2", "kg m²", above(0.0, 1.0), "inertia on the plate's side of the gap"}),
    field<&T::plate_friction_share>(
        {"plate_friction_share", "-", closed(0.0, 1.0), "share of the friction on the plate's side of the gap"}),
    field<&T::bore_mm>({"bore_mm", "mm", above(0.0, 1e3), "bore of the throttle"}),
    field<&T::pressure_drop_kpa>(
        {"pressure_drop_kpa", "kPa", closed(0.0, 200.0), "pressure drop that loads the plate"}),
};

// Shape of the closing torque over the opening: largest near 75 deg, none closed or wide open.
constexpr std::array<double, 11> air_angle_deg{0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 75.0, 80.0, 90.0};
constexpr std::array<double, 11> air_coefficient{0.0,   0.003, 0.008, 0.015, 0.025, 0.040,
                                                 0.060, 0.080, 0.085, 0.070, 0.0};

}  // namespace

std::span<const Field<Throttle>> fields() noexcept {
  return field_table;
}

void validate(const Throttle& t) {
  require_fields(field_table, t);
  if (!(t.closed_deg < t.open_deg)) {
    throw ParameterError("open_deg", t.open_deg, "must be above closed_deg = " + text(t.closed_deg), "deg");
  }
  if (!(t.limp_home_deg >= t.closed_deg && t.limp_home_deg <= t.open_deg)) {
    throw ParameterError("limp_home_deg", t.limp_home_deg,
                         "must lie between closed_deg = " + text(t.closed_deg) + " and open_deg = " + text(t.open_deg),
                         "deg");
  }
  if (t.friction != Friction::coulomb && t.friction != Friction::tanh && !(t.stiction_nm >= t.coulomb_nm)) {
    throw ParameterError(
        "stiction_nm", t.stiction_nm,
        "must be >= coulomb_nm = " + text(t.coulomb_nm) + " for friction = '" + std::string(name_of(t.friction)) + "'",
        "N m");
  }
  if (t.friction == Friction::lugre && !(t.coulomb_nm > 0.0)) {
    throw ParameterError("coulomb_nm", t.coulomb_nm, "must be > 0 for friction = 'lugre'", "N m");
  }
  if (!(t.driver_drop_v < t.supply_v)) {
    throw ParameterError("driver_drop_v", t.driver_drop_v, "must be below supply_v = " + text(t.supply_v), "V");
  }
  if (t.backlash == Backlash::compliance && !(t.plate_inertia_kgm2 < t.inertia_kgm2)) {
    throw ParameterError("plate_inertia_kgm2", t.plate_inertia_kgm2,
                         "must be below inertia_kgm2 = " + text(t.inertia_kgm2) + ", of which it is a part", "kg m²");
  }
}

control::Plate plate_of(const Throttle& t) noexcept {
  const double stall = t.stall_torque_nm();
  const auto side = [stall](double preload_nm, double spring_nm_per_rad) -> control::SpringSideDuty {
    return {preload_nm / stall, spring_nm_per_rad * units::rad_per_deg / stall};
  };
  return {.gain_deg_per_s2 = stall / t.inertia_kgm2 / units::rad_per_deg,
          .time_constant_s = t.inertia_kgm2 / t.damping_nms_per_rad(),
          .electrical_s = 1e-3 * t.inductance_mh / t.resistance_ohm,
          .spring = {.limp_home_deg = t.limp_home_deg,
                     .ramp_deg = control::Plate{}.spring.ramp_deg,
                     .above = side(t.preload_above_nm, t.spring_above_nm_per_rad),
                     .below = side(t.preload_below_nm, t.spring_below_nm_per_rad)},
          .friction = t.coulomb_nm / stall,
          .closed_deg = t.closed_deg,
          .open_deg = t.open_deg};
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
