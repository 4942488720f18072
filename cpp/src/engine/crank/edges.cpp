#include "mgdd/engine/crank/edges.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

constexpr double hysteresis = 0.3;  // of the distance from the level to the nearer of low and high
constexpr double together = 1.4;    // pitches of two neighbouring intervals that are one, cut by an extra edge
constexpr double most_pitches = 1e9;
constexpr std::size_t neighbours = 4;  // intervals on each side that tell the usual one

double share_of(Column values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Median of the intervals around one, which a gap or an extra edge does not move.
double usual_interval(const Column& t, std::size_t k) {
  const std::size_t last = t.size() - 1, from = k > neighbours ? k - neighbours : 0;
  const std::size_t to = std::min(last, k + neighbours + 1);
  double around[2 * neighbours + 1];
  std::size_t n = 0;
  for (std::size_t i = from; i < to; ++i)
    around[n++] = t[i + 1] - t[i];
  std::nth_element(around, around + n / 2, around + n);
  return around[n / 2];
}

}  // namespace

Column edge_times(std::span<const double> time, std::span<const double> given, const EdgeOptions& o, const char* name) {
  Column signal(given.begin(), given.end());
  if (const auto bad = std::ranges::find_if(signal, [](double v) { return !std::isfinite(v); }); bad != signal.end()) {
    throw about(name, DataError(std::string(name) + "[" + std::to_string(bad - signal.begin()) + "] = " + text(*bad) +
                                ": must be finite; drop or repair the sample"));
  }
  double low = share_of(signal, o.spike_share), high = share_of(signal, 1.0 - o.spike_share);
  if (!(high > low)) low = share_of(signal, 0.0), high = share_of(signal, 1.0);
  if (!(high > low))
    throw about(name, DataError(std::string(name) + " stands at " + text(low) + ": there are no edges"));
  const double given_level = o.level.value_or(0.5 * (low + high));
  const double sign = o.falling ? -1.0 : 1.0, level = sign * given_level;
  const double band = hysteresis * std::min(given_level - low, high - given_level);
  if (!(band > 0.0)) {
    throw ParameterError(
        "level", given_level,
        std::string("must lie between low and high of ") + name + ", " + text(low) + " and " + text(high));
  }
  Column out;
  bool armed = false;
  double crossed = 0.0;
  for (std::size_t k = 0; k < signal.size(); ++k) {
    const double v = sign * signal[k];
    if (v < level - band) armed = true;
    if (k > 0 && armed && v > level && sign * signal[k - 1] <= level) {
      const double before = sign * signal[k - 1];
      crossed = time[k - 1] + (time[k] - time[k - 1]) * (level - before) / (v - before);
    }
    if (armed && v > level + band) {
      if (k > 0) out.push_back(crossed);
      armed = false;
    }
  }
  return out;
}

// Leaves edges out that cut one pitch in two.
std::size_t drop_extra(Column& t) {
  Column kept;
  std::size_t dropped = 0;
  for (std::size_t k = 0; k < t.size(); ++k) {
    const bool inside = !kept.empty() && k + 1 < t.size();
    const double usual = inside ? usual_interval(t, k) : 1.0;
    const double both = inside ? (t[k + 1] - kept.back()) / usual : 2.0;
    if (both < together) {
      // Of an edge and its double the one goes whose neighbours are then one pitch apart.
      const bool next_is_double = k + 2 < t.size() && std::abs((t[k + 2] - t[k]) / usual - 1.0) < std::abs(both - 1.0);
      if (!next_is_double) {
        ++dropped;
        continue;
      }
    }
    kept.push_back(t[k]);
  }
  t = std::move(kept);
  return dropped;
}

// Pitches from the first edge to each. No gap counts as more than `most_pitches`, so that their sum fits a word.
std::vector<long> count_pitches(const Column& t) {
  std::vector<long> at(t.size(), 0);
  for (std::size_t k = 0; k + 1 < t.size(); ++k)
    at[k + 1] = at[k] + std::max(1L, std::lround(std::min((t[k + 1] - t[k]) / usual_interval(t, k), most_pitches)));
  return at;
}

}  // namespace mgdd::engine
