// The steepest pressure rise of a trace, as a number that does not depend on the sampling.
#pragma once

#include <vector>

namespace mgdd::engine {

/// Width of the least-squares line whose slope is the pressure rise rate [CAD].
inline constexpr double rise_rate_width_cad = 2.0;

/// Largest slope of the least-squares line over 2 CAD [bar/°CA]. A trace of coarser steps than 0.25 CAD is first
/// divided by cubic interpolation.
double steepest_rise_bar_per_cad(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar);

}  // namespace mgdd::engine
