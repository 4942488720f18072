// Edges of a sampled signal over time, and their count in pitches of a toothed wheel.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace mgdd::engine {

struct EdgeOptions {
  bool falling = false;
  std::optional<double> level{};  ///< none: midway between low and high
  double spike_share = 0.0;       ///< of the samples, which may be spikes and are none of the two levels
};

/// Times at which the signal crosses the level before it is clearly on the other side. DataError that calls it `name`
/// for a sample that is not finite, or a signal that stands.
std::vector<double> edge_times(std::span<const double> time_s, std::span<const double> signal,
                               const EdgeOptions& options, const char* name);

/// Takes edges out that cut one pitch in two, and returns how many.
std::size_t drop_extra(std::vector<double>& edge_s);

/// Pitches from the first edge to each, by the usual interval around.
std::vector<long> count_pitches(const std::vector<double>& edge_s);

}  // namespace mgdd::engine
