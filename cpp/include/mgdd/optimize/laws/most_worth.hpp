// Of inputs that may be asked the one whose J, and what a few readings of it teach about the best of them, is worth
// most (knowledge gradient, Frazier, Powell and Dayanik 2009). noexcept and free of allocation.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace mgdd::optimize {

/// How much the largest of several quantities with these means is expected to rise once a reading of a quantity shows:
/// E max(mean + effect Z) - max mean, Z standard normal (Frazier, Powell and Dayanik 2009). `order` and `breaks` are
/// scratch of the same size.
double knowledge_gradient(std::span<const double> mean, std::span<const double> effect, std::span<int> order,
                          std::span<double> breaks) noexcept;

/// Room for as many inputs as are compared at once.
struct WorthScratch {
  explicit WorthScratch(std::size_t most) : mean(most), effect(most), breaks(most), order(most) {}
  std::vector<double> mean, effect, breaks;
  std::vector<int> order;
};

/// Of those in `kept`, whose J is expected to be `mean(p)` with `covariance(p, q)`, for as many cycles as the horizon.
template <class Mean, class Covariance>
int most_worth(std::span<const int> kept, const Mean& mean, const Covariance& covariance, double noise, double horizon,
               WorthScratch& scratch) noexcept {
  constexpr double planned_readings[] = {1, 4, 16};       // that the worth of an input is reckoned with
  constexpr double rise_of_normal = 0.39894228040143268;  // E max(Z, 0)
  const std::size_t count = kept.size();
  const std::span<double> means(scratch.mean.data(), count), effects(scratch.effect.data(), count);
  for (std::size_t a = 0; a < count; ++a)
    means[a] = mean(kept[a]);
  double most = 0.0;
  int best = -1;
  for (std::size_t a = 0; a < count; ++a) {
    double taught = 0.0, least = covariance(kept[0], kept[a]), steepest = least;
    for (const int b : kept) {
      least = std::min(least, covariance(b, kept[a]));
      steepest = std::max(steepest, covariance(b, kept[a]));
    }
    for (const double readings : planned_readings) {
      const double sd = std::sqrt(std::max(covariance(kept[a], kept[a]), 0.0) + noise * noise / readings);
      if (!(sd > 0.0)) continue;
      // The largest of lines through one point rises by their range of slopes times E max(Z, 0) at most.
      const double at_most = rise_of_normal * (steepest - least) / (sd * readings);
      if (at_most <= taught || (best >= 0 && means[a] + horizon * at_most <= most)) continue;
      for (std::size_t b = 0; b < count; ++b)
        effects[b] = covariance(kept[b], kept[a]) / sd;
      const double gain =
          knowledge_gradient(means, effects, {scratch.order.data(), count}, {scratch.breaks.data(), count});
      taught = std::max(taught, gain / readings);
    }
    const double worth = means[a] + horizon * taught;
    if (best >= 0 && !(worth > most)) continue;
    most = worth;
    best = kept[a];
  }
  return best;
}

}  // namespace mgdd::optimize
