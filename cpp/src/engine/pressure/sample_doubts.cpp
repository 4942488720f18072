#include "mgdd/engine/pressure/sample_doubts.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "mgdd/engine/pressure/warning_text.hpp"

namespace mgdd::engine {
namespace {

constexpr double spike_of_peak = 0.1, quiet_spike_of_peak = 0.01, spike_of_usual = 12.0;
// Five rounded samples are off the cubic by 1.3 steps at most.
constexpr double spike_of_resolution = 2.0;
// No burn that is found is believed here: what stands still or apart moves its ends.
constexpr double zone_from_cad = -30.0, zone_to_cad = 60.0;

bool may_burn(const TraceAnalysis& a, double angle) {
  return !a.motored && angle >= zone_from_cad && angle <= zone_to_cad;
}

// Sample k less the cubic through its two neighbours on each side.
double off_the_cubic(const TraceAnalysis& a, std::size_t k) {
  double expected = 0.0;
  for (const std::size_t i : {k - 2, k - 1, k + 1, k + 2}) {
    double weight = 1.0;
    for (const std::size_t j : {k - 2, k - 1, k + 1, k + 2})
      if (j != i) weight *= (a.angle_cad[k] - a.angle_cad[j]) / (a.angle_cad[i] - a.angle_cad[j]);
    expected += weight * a.pressure_bar[i];
  }
  return a.pressure_bar[k] - expected;
}

// Smallest distance of two values of the same order: what the file or the converter resolves there.
double resolution_bar(const TraceAnalysis& a, double level) {
  std::vector<double> near;
  std::copy_if(a.pressure_bar.begin(), a.pressure_bar.end(), std::back_inserter(near),
               [level](double p) { return p > 0.5 * level && p < 2.0 * level; });
  std::sort(near.begin(), near.end());
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < near.size(); ++k)
    if (near[k] - near[k - 1] > 1e-9 * level) least = std::min(least, near[k] - near[k - 1]);
  return least;
}

void add_spike(TraceAnalysis& a, std::size_t k, double jump_bar) {
  a.warnings.push_back({"spike", "the sample at " + shown(a.angle_cad[k]) + " °CA aTDC stands " + shown(jump_bar) +
                                     " bar off its neighbours: a spike, or a step too coarse"});
}

}  // namespace

void doubt_spikes(TraceAnalysis& a) {
  const std::size_t n = a.pressure_bar.size();
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double jump = a.pressure_bar[k] - 0.5 * (a.pressure_bar[k - 1] + a.pressure_bar[k + 1]);
    if (std::abs(jump) > spike_of_peak * a.p_max_bar) return add_spike(a, k, jump);
  }
  std::vector<double> sizes;
  std::size_t most = 0;
  double jump = 0.0;
  for (std::size_t k = 2; k + 2 < n; ++k) {
    if (may_burn(a, a.angle_cad[k])) continue;
    const double off = off_the_cubic(a, k);
    sizes.push_back(std::abs(off));
    if (std::abs(off) > std::abs(jump)) jump = off, most = k;
  }
  if (sizes.empty()) return;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  const double rounding = spike_of_resolution * resolution_bar(a, a.pressure_bar[most]);
  if (std::abs(jump) > std::max({quiet_spike_of_peak * a.p_max_bar, spike_of_usual * *middle, rounding})) {
    add_spike(a, most, jump);
  }
}

}  // namespace mgdd::engine
