// Pseudo-Wiener parameters without symmetry: no default, and every number of a side differs from the other's.
#pragma once

#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::test {

using throttle::PwP;
using throttle::PwR;
using throttle::PwW;

inline PwR asymmetric_pw_r() {
  PwR p;
  p.above = {0.021, 74000.0, 0.121, 6.1e-4, 0.083, 1.3e-3, -1.1e-5};
  p.below = {0.034, 61000.0, 0.097, 1.7e-3, 0.062, 2.9e-3, 2.3e-5};
  p.limp_home_deg = 13.0;
  p.frame = {.closed_deg = 1.5, .open_deg = 84.0, .sample_s = 2e-3, .substeps = 3, .delay_samples = 2};
  p.ramp_deg = 0.6;
  p.tanh_deg_per_s = 22.0;
  p.dead_band_deg = 0.45;
  return p;
}
inline PwW asymmetric_pw_w() {
  PwW p;
  p.first_s = 0.031;
  p.second_s = 0.11;
  p.base_deg = 2.5;
  p.rise_deg = {1.0, 4.0, 9.0, 30.0, 17.0, 6.0};
  p.knot_lower_duty = -0.27;
  p.knot_upper_duty = 0.51;
  p.frame = {.closed_deg = 1.5, .open_deg = 84.0, .sample_s = 2e-3, .substeps = 3, .delay_samples = 2};
  return p;
}
inline PwP asymmetric_pw_p() {
  PwP p;
  p.first_s = 0.031;
  p.second_s = 0.11;
  p.offset_deg = 3.0;
  p.plays = 3;
  p.radius_duty = {0.02, 0.05, 0.11};
  p.gain_deg_per_duty = {90.0, 60.0, 35.0};
  p.limp_home_deg = 13.0;
  p.frame = {.closed_deg = 1.5, .open_deg = 84.0, .sample_s = 2e-3, .substeps = 3, .delay_samples = 2};
  return p;
}

}  // namespace mgdd::test
