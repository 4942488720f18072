// The level of a pressure trace: what to add to it, and what its compression says about its level. Randolph 1990; Brunt
// and Pond 1997. Pressure bar, angles °CA aTDC.
#pragma once

#include <vector>

#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/pressure/trace_options.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/weighted_sum.hpp"

namespace mgdd::engine {

/// Offset to add to a relative trace [bar], from all of its samples. DataError where the angles that the method reads
/// are not there.
WeightedSum pegging_of(const std::vector<double>& angle_cad, const Cylinder& cylinder, const TraceOptions& options);

/// Exponent of p V^n = const over [from, to] from the logarithms of all samples; empty with fewer than three there.
WeightedSum exponent_of_logarithms(const std::vector<double>& angle_cad, const std::vector<double>& volume,
                                   double from_cad, double to_cad);

/// Exponent of p V^n = const by regression of ln p on ln V over [from, to]; NaN with fewer than three samples there.
double polytropic_exponent(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                           const Cylinder& cylinder, double from_cad, double to_cad);

/// The same with the volume of every sample at hand, in any unit.
double polytropic_exponent(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                           const std::vector<double>& volume, double from_cad, double to_cad);

/// Compression fitted by p + offset = C V^-n with offset and n both free (Gauss-Newton).
struct FreePolytrope {
  double exponent = undefined<double>();
  double offset_bar = undefined<double>();
  double offset_stderr_bar = undefined<double>();  ///< by the scatter of the fit
};
/// NaN where [from, to] holds fewer than ten samples or less than 40 CAD, or the fit does not settle.
FreePolytrope free_polytrope(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                             const std::vector<double>& volume_l, double from_cad, double to_cad);

}  // namespace mgdd::engine
