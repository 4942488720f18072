// Up to eight healthy virtual throttles side by side: the plants in SIMD lanes, each with its own sensors, every sample
// with the bits that `VirtualThrottle` gives. Angles in deg, duty -1..1, time in s. `step` is noexcept,
// allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/loop/virtual_throttle.hpp"
#include "mgdd/throttle/plant_lanes.hpp"

namespace mgdd::loop {

/// Whether two may run side by side: without faults of the plant, and alike in sample time, step, bridge and the forms
/// of friction and backlash.
bool side_by_side(const VirtualThrottleSettings& one, const VirtualThrottleSettings& other) noexcept;

class VirtualThrottleLanes {
 public:
  static constexpr auto width = static_cast<std::size_t>(throttle::PlantLanes::width);

  /// ParameterError for none, more than eight, bad settings, or settings that may not run side by side.
  explicit VirtualThrottleLanes(std::span<const VirtualThrottleSettings> settings);

  std::size_t size() const noexcept { return last_.size(); }

  /// Runs one sample of each; inputs as for `VirtualThrottle::step`, but with no open bridge. One entry per throttle.
  void step(std::span<const VirtualThrottleInputs> inputs, std::span<VirtualThrottleSample> out) noexcept;

 private:
  std::vector<throttle::SensorSampler> sensors_;
  std::vector<VirtualThrottleInputs> last_;
  throttle::PlantLanes plants_;
  throttle::Bridge bridge_;
  std::size_t steps_;
  std::int64_t samples_ = 0;
};

}  // namespace mgdd::loop
