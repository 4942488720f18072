// A demand chain without symmetry: no number has its default, no two are equal.
#pragma once

#include "mgdd/throttle/demand/demand_chain.hpp"

namespace mgdd::test_support {

inline throttle::IntakeAir odd_air() {
  return {.displacement_l = 1.62,
          .volumetric_efficiency = 0.91,
          .manifold_l = 2.3,
          .manifold_temperature_k = 323.0,
          .ambient_kpa = 96.4,
          .ambient_temperature_k = 287.0};
}

inline throttle::ThrottleBore odd_bore(double pressure_loss = 0.07) {
  return {.bore_mm = 52.0,
          .shaft_mm = 9.0,
          .plate_closed_deg = 11.0,
          .leak_mm2 = 4.0,
          .discharge_5 = 0.61,
          .discharge_20 = 0.72,
          .discharge_45 = 0.83,
          .discharge_90 = 0.91,
          .discharge_pressure_loss = pressure_loss};
}

inline throttle::DemandChain odd_chain() {
  throttle::DemandChain chain;
  chain.torque = {.indicated_efficiency = 0.36,
                  .heating_value_mj_per_kg = 43.1,
                  .stoichiometric_air_fuel = 14.3,
                  .air_fuel_ratio = 1.04,
                  .friction_nm = 11.0,
                  .friction_nm_per_rpm = 0.0041};
  chain.air = odd_air();
  chain.bore = odd_bore();
  return chain;
}

}  // namespace mgdd::test_support
