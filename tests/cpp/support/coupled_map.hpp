// A coupled map of timing and EGR for seekers of several inputs, with noise by seed and cycle.
#pragma once

#include <cstdint>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"

namespace mgdd::optimize {

// Timing and EGR: unlike scales, coupled.
inline GaussianProcessSeekingSettings two_inputs(std::uint64_t seed) {
  GaussianProcessSeekingSettings s;
  s.space.inputs = {{.name = "soc_cad", .lower = -25.0, .upper = 15.0}, {.name = "egr", .lower = 0.0, .upper = 0.4}};
  s.space.start = Inputs(2);
  s.space.start << 4.0, 0.31;
  s.seed = seed;
  return s;
}

inline double lost(const Inputs& x, double best_soc = -4.0) {
  const double a = x[0] - best_soc, b = 100.0 * (x[1] - 0.2);
  return 0.03 * (a * a + b * b + 1.2 * a * b);
}

inline double noise(std::uint64_t seed, int cycle, double sd = 0.3) {
  return sd * random::normal(seed, 9, static_cast<std::uint64_t>(cycle));
}

}  // namespace mgdd::optimize
