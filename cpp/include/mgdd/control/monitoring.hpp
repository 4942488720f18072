// What every monitor of a throttle asks of its samples: how long something has lasted, how old a measurement is,
// whether two sensors of one quantity are in range and agree, whether a pushed plate stands still. Thresholds belong to
// the callers. noexcept and allocation-free; NaN counts as what did not arrive and fails every check.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "mgdd/common/bounds.hpp"

namespace mgdd::control {

/// Share of a sample by which a time may miss a whole number of them.
inline constexpr double sample_rounding = 1e-6;

/// Whether so many samples make up the time.
inline bool lasted(double samples, double sample_s, double time_s) noexcept {
  return (samples + sample_rounding) * sample_s >= time_s;
}

/// What a good sample takes back from the count of failing ones: an input that fails in more than every third sample is
/// told in the end, however often it looks well between; rarer ones never add up.
inline constexpr double leak = 0.5;

/// Count of failing samples after these, never above `most`: what was told long ago does not last.
inline double leaky(double count, double samples, bool failing, double most) noexcept {
  return failing ? std::min(count + samples, std::max(count, most)) : std::max(0.0, count - leak * samples);
}

/// Whether an age is beyond the largest one.
inline bool older(double age_s, double largest_s, double sample_s) noexcept {
  return age_s > largest_s + sample_rounding * sample_s;
}

/// Age of the last measurement: as told, else a sample more than before.
inline double aged(bool arrived, double age_s, double before_s, double sample_s) noexcept {
  return arrived ? age_s : before_s + sample_s;
}

/// Two readings of one quantity, with the range of each and how they differ.
struct PairCheck {
  std::array<bool, 2> in_range;
  bool agree;  ///< says nothing of a pair of which one is out of range

  bool all_in_range() const noexcept { return in_range[0] && in_range[1]; }
  bool healthy() const noexcept { return all_in_range() && agree; }
  /// The first one, the second where only that is in range.
  std::size_t usable() const noexcept { return in_range[0] || !in_range[1] ? 0 : 1; }
};
inline PairCheck check_pair(const std::array<double, 2>& readings, const Domain& range, double difference,
                            double tolerance) noexcept {
  return {{range.contains(readings[0]), range.contains(readings[1])}, std::abs(difference) < tolerance};
}

/// From where a pushed plate has to move, and for how many samples it has not.
inline void follow_standstill(bool excused, double angle_deg, double move_deg, double& anchor_deg,
                              double& samples) noexcept {
  if (excused || std::abs(angle_deg - anchor_deg) > move_deg) {
    anchor_deg = angle_deg;
    samples = 0.0;
  }
}

}  // namespace mgdd::control
