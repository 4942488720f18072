// The throttles of the study of controllers: the presets P1 (with stiction of 0.3 N m), P2 and P3, others drawn around
// them, and what a predictive controller knows of one.
#pragma once

#include <cstdint>

#include "mgdd/common/random.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/control/plate_model.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::test_support {

inline throttle::Throttle preset(int number) {
  throttle::Throttle t;  // P1
  t.friction = throttle::Friction::stribeck;
  t.stiction_nm = 0.3;  // as in the study
  if (number == 2) {
    t.coulomb_nm = 0.1;
    t.stiction_nm = 0.11;
    t.spring_above_nm_per_rad = t.spring_below_nm_per_rad = 0.819;
    t.preload_above_nm = t.preload_below_nm = 0.2;
  } else if (number == 3) {
    t.friction = throttle::Friction::coulomb;
    t.coulomb_nm = t.stiction_nm = 0.089;
    t.inertia_kgm2 = 0.0035;
    t.viscous_nms_per_rad = 0.1503;
    t.torque_constant_nm_per_a = 0.24;
    t.back_emf_vs_per_rad = t.inductance_mh = 0.0;
    t.resistance_ohm = 1.0;
    t.limp_home_deg = 12.0;
    t.spring_above_nm_per_rad = t.spring_below_nm_per_rad = 0.0914;
    t.preload_above_nm = t.preload_below_nm = 0.3193;
  }
  return t;
}

/// Seven numbers of a throttle, each multiplied by one from 1 - spread to 1 + spread.
inline throttle::Throttle drawn(throttle::Throttle t, double spread, std::uint64_t seed) {
  std::uint64_t index = 0;
  const auto factor = [&] { return 1.0 + spread * (2.0 * random::uniform(seed, 0, index++) - 1.0); };
  const auto scale = [&](auto&... numbers) {
    const double by = factor();
    ((numbers *= by), ...);
  };
  scale(t.inertia_kgm2);
  scale(t.viscous_nms_per_rad);
  scale(t.torque_constant_nm_per_a, t.back_emf_vs_per_rad);
  scale(t.resistance_ohm);
  scale(t.spring_above_nm_per_rad, t.spring_below_nm_per_rad);
  scale(t.preload_above_nm, t.preload_below_nm);
  scale(t.coulomb_nm, t.stiction_nm);
  return t;
}

}  // namespace mgdd::test_support
