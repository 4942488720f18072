// Where the burn of a pressure trace starts and ends, and whether there is one. Angles °CA aTDC.
#pragma once

#include <optional>
#include <vector>

#include "mgdd/engine/geometry.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

/// Half the width over which rates are taken, and the shortest stretch that counts as a burn [CAD].
inline constexpr double burn_rate_half_cad = 2.0;
/// A burn is where the heat release exceeds this share of its peak, and four times its scatter without a burn.
inline constexpr double burn_threshold = 0.01;
/// The window of the heat starts this much before the burn and ends this much after it [CAD].
inline constexpr double heat_margin_before_cad = 5.0;
inline constexpr double heat_margin_after_cad = 20.0;

struct BurnWindow {
  bool found = false;  ///< heat release stands out of its scatter
  double start_cad = undefined<double>();
  double end_cad = undefined<double>();
  double unbounded_start_cad = undefined<double>();  ///< the start without `earliest_cad`, for a check of it
};

/// Start: net heat release with gamma set to the fitted exponent of compression, so that compression releases nothing,
/// first exceeds the threshold. End: the same with the exponent of the late expansion, seen from behind. No start is
/// looked for before `earliest_cad`, nor before -50.
BurnWindow find_burn(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                     const std::vector<double>& volume_l, std::optional<double> earliest_cad);

/// Regression of ln p(+d)/p(-d), d from 60 to 120 CAD, on {1, d ln V/d phi}: the first coefficient is what a burn adds
/// to (and the walls take from) p V^n, the second 2 n times the error of top dead centre.
struct Symmetry {
  double burn_step = undefined<double>();       ///< [-]; NaN where the trace does not reach 80 CAD on both sides
  double tdc_offset_cad = undefined<double>();  ///< what the angles are too large by; good to 1.4 CAD, motored only
};
Symmetry compare_strokes(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                         const Geometry<double>& geometry);
/// Below it a trace is motored: simulated motored traces stay under 0.01, a closed IMEP of 0.5 bar gives 0.035.
inline constexpr double motored_burn_step = 0.02;
/// The same where no burn stands out of the scatter either: then noise of the pressure is the likelier cause.
inline constexpr double motored_burn_step_unseen = 0.06;

}  // namespace mgdd::engine
