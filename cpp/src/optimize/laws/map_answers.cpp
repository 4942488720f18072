// What a map says of its cells: the best input of each, what may be lost by it, and how surely it keeps the limits.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/belief/row_cholesky.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"

namespace mgdd::optimize {
namespace {

constexpr std::uint64_t regret_samples = 32;
constexpr double least_pivot = 1e-6;   // of the largest variance
constexpr double least_known = 1e-10;  // of a squared bend: a variance below it is not told from rounding
constexpr double least_share = 1e-2;   // of that, so that rounding leaves a matrix positive

}  // namespace

// Regret and place by samples of J at the candidates of a cell that keep its limits.
void MapSeeking::sample(std::size_t c, Best& out) noexcept {
  if (out.excess > 0.0) {  // nothing is known to be safe: all that J ranges over may be lost
    double low = j_.mean(point_of(c, 0)), high = low;
    for (int k = 1; k < per_place; ++k) {
      low = std::min(low, j_.mean(point_of(c, k)));
      high = std::max(high, j_.mean(point_of(c, k)));
    }
    out.regret = high - low;
    out.input_sd = settings_.space.upper - settings_.space.lower;
    return;
  }
  const std::span<const int> kept(&safe_[static_cast<std::size_t>(safe_from_[c])],
                                  static_cast<std::size_t>(safe_from_[c + 1] - safe_from_[c]));
  const auto n = static_cast<Eigen::Index>(kept.size());
  const auto at = [&](Eigen::Index k) { return kept[static_cast<std::size_t>(k)]; };
  double widest = 0.0;
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b <= a; ++b)
      joint_(a, b) = j_.covariance(at(a), at(b));
    widest = std::max(widest, joint_(a, a));
  }
  const double rounding = least_known * std::pow(j_.bend(), 2.0);
  if (!(widest > rounding)) return;
  for (Eigen::Index a = 0; a < n; ++a)
    joint_(a, a) = std::max(joint_(a, a), 0.0) + std::max(least_pivot * widest, least_share * rounding);
  cholesky(joint_, n);
  Inputs squares = Inputs::Zero(inputs_);
  for (std::uint64_t s = 0; s < regret_samples; ++s) {
    for (Eigen::Index k = 0; k < n; ++k) {
      worth_.effect[static_cast<std::size_t>(k)] =
          random::normal(settings_.seed, 450 + s, static_cast<std::uint64_t>(k));
    }
    double most = 0.0, own = 0.0;
    Eigen::Index best = 0;
    for (Eigen::Index k = 0; k < n; ++k) {
      const double value = worth(at(k)) + dot(&joint_(k, 0), worth_.effect.data(), k + 1);
      if (k == 0) own = most = value;
      if (value <= most) continue;
      most = value;
      best = k;
    }
    out.regret += (most - own) / regret_samples;
    const Inputs off = candidates_.row(at(best)).tail(inputs_).transpose() - places_[c].best;
    squares += off.cwiseAbs2() / regret_samples;
  }
  out.input_sd = squares.cwiseSqrt().cwiseProduct(settings_.space.upper - settings_.space.lower);
}

MapSeeking::Best MapSeeking::best(std::size_t c) noexcept {
  if (!known()) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    return {unscaled(first_input(cell(c))), settings_.space.upper - settings_.space.lower, nan, nan, nan, nan};
  }
  know_cells();
  const int at = places_[c].known;
  const double expected = (settings_.maximize ? 1.0 : -1.0) * j_.mean(at);
  const Inputs input = unscaled(candidates_.row(at).tail(inputs_).transpose());
  Best out{input, Inputs::Zero(inputs_), expected, j_.sd(at), 0.0, over_[static_cast<std::size_t>(at)]};
  sample(c, out);
  return out;
}

void MapSeeking::know_cells() noexcept {
  if (!searched_) search(all_cells());
  searched_ = true;
}

double MapSeeking::holds(std::size_t c, std::size_t i) noexcept {
  if (!known()) return 0.0;
  know_cells();
  const int at = places_[c].known;
  const double sd = limited_[i].sd(at), mean = limited_[i].excess(at, 0.0);
  return 0.5 * std::erfc(mean / (std::max(sd, 1e-300) * std::numbers::sqrt2));
}

}  // namespace mgdd::optimize
