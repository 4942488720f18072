// A throttle without any symmetry: no number has its default, no two numbers are equal, so that a swapped side, a
// dropped term or a wrong sign cannot hide. Use it wherever a test is not about one particular throttle.
#pragma once

#include "mgdd/throttle/throttle.hpp"

namespace mgdd::test {

inline throttle::Throttle asymmetric_throttle() {
  throttle::Throttle t;
  t.inertia_kgm2 = 0.0026;
  t.viscous_nms_per_rad = 0.0102;
  t.torque_constant_nm_per_a = 0.35;
  t.back_emf_vs_per_rad = 0.41;
  t.resistance_ohm = 1.7;
  t.inductance_mh = 1.1;
  t.supply_v = 13.3;
  t.driver_drop_v = 0.6;
  t.driver_resistance_ohm = 0.22;
  t.dead_band = 0.03;
  t.coulomb_nm = 0.17;
  t.stiction_nm = 0.23;
  t.stribeck_rad_per_s = 0.45;
  t.karnopp_rad_per_s = 0.07;
  t.tanh_rad_per_s = 0.08;
  t.bristle_nm_per_rad = 95.0;
  t.bristle_damping_nms_per_rad = 0.43;
  t.limp_home_deg = 11.0;
  t.spring_above_nm_per_rad = 0.21;
  t.spring_below_nm_per_rad = 0.33;
  t.preload_above_nm = 0.31;
  t.preload_below_nm = 0.24;
  t.preload_ramp_deg = 0.4;
  t.closed_deg = 1.5;
  t.open_deg = 86.0;
  t.stop_stiffness_nm_per_rad = 4200.0;
  t.stop_damping_nms_per_rad = 3.1;
  t.backlash_half_deg = 0.27;
  t.gear_stiffness_nm_per_rad = 260.0;
  t.gear_damping_nms_per_rad = 0.28;
  t.plate_inertia_kgm2 = 0.0005;
  t.plate_friction_share = 0.36;
  t.bore_mm = 52.0;
  t.pressure_drop_kpa = 7.0;
  return t;
}

}  // namespace mgdd::test
