#include "mgdd/throttle/plant.hpp"

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::throttle {
namespace {

using units::rad_per_deg;

double checked_step(const Throttle& throttle, double step_s) {
  validate(throttle);
  require_within("step_s", step_s, step_lower_s, step_upper_s, "s");
  return step_s;
}

// Bristles side by side: their deflection at full friction is the same on both sides of the gap.
FrictionCoefficients<double> share_of_friction(const Throttle& t, double share) noexcept {
  return {share * t.viscous_nms_per_rad,
          {share * t.coulomb_nm, share * t.stiction_nm},
          {share * t.bristle_nm_per_rad, share * t.bristle_damping_nms_per_rad}};
}

// Every option on every scalar of the contract.
static_assert(dynamics::StartsAtRest<ThrottlePlant> && dynamics::StartsAtRest<BasicThrottlePlant<float>> &&
              dynamics::StartsAtRest<BasicThrottlePlant<Dual<3>>> &&
              dynamics::StartsAtRest<BasicThrottlePlant<Dual<3, float>, float>> &&
              dynamics::StartsAtRest<BasicThrottlePlant<Lanes<8>>>);

}  // namespace

PlantCoefficients<double> plant_coefficients(const Throttle& t, double h) noexcept {
  const double inductance_over_h = 1e-3 * t.inductance_mh / h;
  const double resistance = t.resistance_ohm + t.driver_resistance_ohm;
  const double plate = t.plate_friction_share;
  const double bore_m = t.bore_mm * units::m_per_mm;
  PlantCoefficients<double> c{};
  c.whole = share_of_friction(t, 1.0);
  c.motor_side = share_of_friction(t, 1.0 - plate);
  c.plate_side = share_of_friction(t, plate);
  c.inertia_over_h = t.inertia_kgm2 / h;
  c.motor_inertia_over_h = (t.inertia_kgm2 - t.plate_inertia_kgm2) / h;
  c.plate_inertia_over_h = t.plate_inertia_kgm2 / h;
  c.torque_constant = t.torque_constant_nm_per_a;
  c.back_emf = t.back_emf_vs_per_rad;
  c.inductance_over_h = inductance_over_h;
  c.resistance = resistance;
  c.inverse_impedance = 1.0 / (inductance_over_h + resistance);
  c.drop = t.driver_drop_v;
  c.dead_band = t.dead_band;
  c.shape = {1.0 / t.stribeck_rad_per_s, t.karnopp_rad_per_s, 1.0 / t.tanh_rad_per_s};
  c.limp_home = t.limp_home_deg * rad_per_deg;
  c.above = {t.spring_above_nm_per_rad, t.preload_above_nm};
  c.below = {t.spring_below_nm_per_rad, t.preload_below_nm};
  c.inverse_ramp = 1.0 / (t.preload_ramp_deg * rad_per_deg);
  c.closed = t.closed_deg * rad_per_deg;
  c.open = t.open_deg * rad_per_deg;
  c.stop = t.stop_stiffness_nm_per_rad;
  c.stop_implicit = h * t.stop_stiffness_nm_per_rad + t.stop_damping_nms_per_rad;
  c.half_gap = t.backlash_half_deg * rad_per_deg;
  c.gear = t.gear_stiffness_nm_per_rad;
  c.gear_damping = t.gear_damping_nms_per_rad;
  c.gear_implicit = h * t.gear_stiffness_nm_per_rad + t.gear_damping_nms_per_rad;
  c.air_torque = -bore_m * bore_m * bore_m * t.pressure_drop_kpa * units::pa_per_kpa;
  c.supply = t.supply_v;
  return c;
}

template <>
BasicThrottlePlant<double, double>::BasicThrottlePlant(const Throttle& throttle, double step_s)
    : BasicThrottlePlant(plant_coefficients(throttle, checked_step(throttle, step_s)), throttle, step_s) {}

ThrottleState at_rest(double angle_deg) noexcept {
  ThrottleState state;
  state.angle_rad = state.plate_angle_rad = angle_deg * rad_per_deg;
  return state;
}

}  // namespace mgdd::throttle
