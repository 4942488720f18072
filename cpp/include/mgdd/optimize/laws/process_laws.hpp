// What the laws by Gaussian processes share.
#pragma once

#include <string>
#include <vector>

#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/belief/surface.hpp"

namespace mgdd::optimize {

inline constexpr double cautious_cycles = 40.0;   ///< in all of which a limit is to hold with the stated probability
inline constexpr double cautious_readings = 5.0;  ///< per input and one: before them the horizon is shorter
inline constexpr double worth_noise = 1e-12;      ///< of a reading, over J, at least
inline constexpr double doubt_age = 10.0;         ///< memories, by which a doubt ages what is known
inline constexpr double slope_step = 0.01;        ///< ranges
inline constexpr double cloud_nearest = 0.011, cloud_farthest = 0.3;  ///< ranges, of inputs that are compared

/// None, or one of each; a guide says something of every input, and not the same everywhere.
void require_guides(const std::string& name, const std::vector<Surface>& guides, std::size_t count,
                    const std::string& whose, Eigen::Index inputs);

/// ParameterError unless every input has finite bounds.
void require_finite_bounds(const SearchSpace& space);

}  // namespace mgdd::optimize
