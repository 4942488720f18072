// The step that gains most within linear limits: a quadratic program of a few inputs, by dual coordinate ascent
// (Hildreth 1957). noexcept and free of allocation.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "mgdd/optimize/ask_tell/inputs.hpp"

namespace mgdd::optimize {

/// Slopes flatter than this, in scales of a limit per range of an input, point nowhere.
inline constexpr double least_slope = 1e-3;

/// The d with `low` <= d <= `high` and `over` + `edges` d <= 0, as far as there is one, where `rise`' d less half of
/// `bend`' d^2 is largest; `bend` > 0. `multipliers`: what that would gain by each limit, were it wider by its scale.
template <class Edges>
Inputs limited_step(const Inputs& rise, const Inputs& bend, const Edges& edges, std::span<const double> over,
                    const Inputs& low, const Inputs& high, std::span<double> multipliers) noexcept {
  constexpr int sweeps = 400;
  constexpr double settled = 1e-7;  // ranges, of a sweep
  std::fill(multipliers.begin(), multipliers.end(), 0.0);
  Inputs step = rise.cwiseQuotient(bend), held_low = Inputs::Zero(rise.size()), held_high = held_low;
  double moved = 0.0;
  const auto more = [&](double& multiplier, double by) {
    const double was = multiplier;
    multiplier = std::max(0.0, was + by);
    return multiplier - was;
  };
  const auto move = [&](Eigen::Index k, double by) {
    step[k] += by;
    moved = std::max(moved, std::abs(by));
  };
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    moved = 0.0;
    for (std::size_t i = 0; i < multipliers.size(); ++i) {
      const auto edge = edges.row(static_cast<Eigen::Index>(i)).transpose();
      if (!(edge.squaredNorm() > least_slope * least_slope)) continue;
      const Inputs away = edge.cwiseQuotient(bend);
      const double by = more(multipliers[i], (over[i] + edge.dot(step)) / edge.dot(away));
      for (Eigen::Index k = 0; k < step.size(); ++k)
        move(k, -by * away[k]);
    }
    for (Eigen::Index k = 0; k < step.size(); ++k) {
      move(k, -more(held_high[k], (step[k] - high[k]) * bend[k]) / bend[k]);
      move(k, more(held_low[k], (low[k] - step[k]) * bend[k]) / bend[k]);
    }
    if (moved < settled) break;
  }
  return step.cwiseMax(low).cwiseMin(high);
}

}  // namespace mgdd::optimize
