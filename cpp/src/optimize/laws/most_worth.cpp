#include "mgdd/optimize/laws/most_worth.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace mgdd::optimize {

double knowledge_gradient(std::span<const double> mean, std::span<const double> effect, std::span<int> order,
                          std::span<double> breaks) noexcept {
  std::iota(order.begin(), order.end(), 0);
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return effect[at(a)] < effect[at(b)] || (effect[at(a)] == effect[at(b)] && mean[at(a)] < mean[at(b)]);
  });
  // The upper envelope of the lines mean + effect Z; breaks[k] is where line k + 1 of it takes over.
  std::size_t lines = 0;
  for (const int next : order) {
    while (lines > 0) {
      const int last = order[lines - 1];
      const double steeper = effect[at(next)] - effect[at(last)];
      if (steeper > 0.0) {
        const double crossing = (mean[at(last)] - mean[at(next)]) / steeper;
        if (lines == 1 || crossing > breaks[lines - 2]) {
          breaks[lines - 1] = crossing;
          break;
        }
      }
      --lines;
    }
    order[lines++] = next;
  }
  double out = 0.0;
  for (std::size_t k = 0; k + 1 < lines; ++k) {
    const double off = -std::abs(breaks[k]);
    const double density = std::exp(-0.5 * off * off) / std::sqrt(2.0 * std::numbers::pi);
    const double below = 0.5 * std::erfc(-off / std::numbers::sqrt2);
    out += (effect[at(order[k + 1])] - effect[at(order[k])]) * (density + off * below);
  }
  return out;
}

}  // namespace mgdd::optimize
