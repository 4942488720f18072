// The groups of the first-principle throttle by name, and its options for a throttle.
#pragma once

#include <cstddef>

#include "mgdd/throttle/models/first_principle.hpp"

namespace mgdd::test_support {

using Groups = throttle::FirstPrinciple::Groups<double>;
enum GroupAt : std::size_t {
  tau,
  gain,
  beta,
  kappa,
  delta,
  beta_below,
  kappa_below,
  home,
  lag,
  drop,
  falls,
  ramp,
  delay,
  bend,
  bend_damping,
  half_gap,
  viscous,
  stop,
  stop_damping
};

inline throttle::FirstPrinciple options_of(const throttle::Throttle& t) {
  throttle::FirstPrinciple options;
  options.closed_deg = t.closed_deg;
  options.open_deg = t.open_deg;
  options.substeps = 10;
  return options;
}

}  // namespace mgdd::test_support
