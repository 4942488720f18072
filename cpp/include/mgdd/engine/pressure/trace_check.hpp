// The rules that a pressure trace must meet before anything is computed from it.
#pragma once

#include <vector>

namespace mgdd::engine {

/// No piston engine runs above it; kPa or Pa taken for bar do.
inline constexpr double highest_pressure_bar = 500.0;

/// Throws ShapeError or DataError, naming index, value and remedy, unless angles [°CA aTDC] and pressures [bar] have
/// the same length (>= 20), are finite, and angles increase strictly without a gap (a step over 1.5 times the median).
/// A highest pressure above 500 bar is refused as a wrong unit (Pa or kPa).
void check_trace(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar);

}  // namespace mgdd::engine
