// What J would gain at a point by each limit and bound that holds it back there, were it wider by its scale: the
// multipliers of Lagrange, by non-negative least squares in turns. noexcept and free of allocation.
#pragma once

#include <algorithm>
#include <span>

#include "mgdd/optimize/ask_tell/inputs.hpp"

namespace mgdd::optimize {

/// Slopes flatter than this, in scales of a limit per range of an input, point nowhere.
inline constexpr double least_slope = 1e-3;

/// `rise`: slopes of J per range; `edges`: a row of slopes per limit; `active`: whether it holds back; `at`: the point
/// in ranges, for the bounds.
template <class Edges, class Active>
void multipliers(Inputs rise, const Inputs& at, const Edges& edges, const Active& active,
                 std::span<double> out) noexcept {
  constexpr int sweeps = 60;
  constexpr double at_bound = 1e-3;  // ranges
  std::fill(out.begin(), out.end(), 0.0);
  Inputs held = Inputs::Zero(at.size());  // by bounds
  const auto more = [](double& multiplier, double by) {
    const double was = multiplier;
    multiplier = std::max(0.0, was + by);
    return multiplier - was;
  };
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const auto edge = edges.row(static_cast<Eigen::Index>(i));
      const double steep = edge.squaredNorm();
      if (!active(i) || !(steep > least_slope * least_slope)) continue;
      rise -= more(out[i], edge.dot(rise) / steep) * edge.transpose();
    }
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      const double side = at[k] < at_bound ? -1.0 : at[k] > 1.0 - at_bound ? 1.0 : 0.0;
      if (side != 0.0) rise[k] -= side * more(held[k], side * rise[k]);
    }
  }
}

}  // namespace mgdd::optimize
