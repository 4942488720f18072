// A throttle as a controller or a bus sees it: inputs of a sample in, what both position sensors say at its end out.
// Angles in deg from the closed position, duty -1..1, time in s. `step` is noexcept and allocation-free.
// The plant is throttle/plant.hpp with sub-steps, the sensors are throttle/sensors.hpp; equal seeds give equal noise.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/loop/throttle_faults.hpp"
#include "mgdd/throttle/plant.hpp"
#include "mgdd/throttle/sensors.hpp"

namespace mgdd::loop {

struct VirtualThrottleSettings {
  throttle::Throttle throttle{};
  throttle::SensorPair sensors{};
  std::array<throttle::SensorFault, 2> faults{};  ///< of the sensors
  std::vector<ThrottleFault> plant_faults{};      ///< of all else, 32 at most
  double sample_s = 1e-3;
  double step_s = throttle::default_step_s;
  double start_deg = 0.0;  ///< at rest, without current
  throttle::Bridge bridge = throttle::Bridge::brake;
  std::uint64_t seed = 0;
};
/// ParameterError naming field, value and bound.
void validate(const VirtualThrottleSettings& settings);

/// What acts during one sample.
struct VirtualThrottleInputs {
  double duty = 0.0;               ///< clipped to -1..1
  double supply_v = 12.0;          ///< of the bridge
  double airflow_torque_nm = 0.0;  ///< positive when it opens
  bool bridge_open = false;        ///< no current whatever the duty: the safe state; else the bridge of the settings
};

/// The end of one sample: what is measured, and the truth behind it.
struct VirtualThrottleSample {
  std::int64_t sample = 0;           ///< samples run so far, this one included
  throttle::SensorReading sensed{};  ///< as it arrived: numbers are NaN where none did
  double age_s = 0.0;                ///< of what arrived last
  double supply_v = 0.0;             ///< of the bridge
  double angle_deg = 0.0;
  double speed_deg_per_s = 0.0;
  double current_a = 0.0;
};

/// Inputs of a sample, with the last ones where they are not finite.
VirtualThrottleInputs taken(const VirtualThrottleInputs& now, const VirtualThrottleInputs& last) noexcept;

/// The truth at the end of a sample.
VirtualThrottleSample sample_of(const throttle::ThrottleState& state, double angle_deg) noexcept;

class VirtualThrottle {
 public:
  explicit VirtualThrottle(const VirtualThrottleSettings& settings);

  /// Runs one sample; inputs that are not finite repeat the last ones.
  VirtualThrottleSample step(const VirtualThrottleInputs& inputs) noexcept;

  const VirtualThrottleSettings& settings() const noexcept { return settings_; }
  std::int64_t samples() const noexcept { return samples_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("samples", self.samples_, counts_end);
    v("angle_rad", self.state_.angle_rad);
    v("speed_rad_per_s", self.state_.speed_rad_per_s);
    v("current_a", self.state_.current_a);
    v("bristle_rad", self.state_.bristle_rad);
    v("plate_angle_rad", self.state_.plate_angle_rad);
    v("plate_speed_rad_per_s", self.state_.plate_speed_rad_per_s);
    v("plate_bristle_rad", self.state_.plate_bristle_rad);
    v("duty", self.last_.duty);
    v("supply_v", self.last_.supply_v);
    v("airflow_torque_nm", self.last_.airflow_torque_nm);
    throttle::SensorSampler::visit(self.sensors_, v);
    if (self.settings_.plant_faults.empty()) return;
    auto& r = self.received_;
    v("caught", self.caught_, std::int64_t{1} << self.settings_.plant_faults.size());
    v("received_sample", self.received_sample_, counts_end);
    v("received_v", r.volts);
    v("received_angle_deg", r.angle_deg);
    v("received_sum_error_v", r.sum_error_v);
    v("received_first_range_fault", r.range_fault[0]);
    v("received_second_range_fault", r.range_fault[1]);
    v("received_sum_fault", r.sum_fault);
    v("received_fault", r.fault);
  }

 private:
  std::int64_t acting() const noexcept;                       // on the plant, one bit per fault
  void use(std::int64_t faults) noexcept;                     // the plant under these
  void catch_plate(double from_deg, double to_deg) noexcept;  // by a jam that waits between these angles
  void transmit(VirtualThrottleSample& sample) noexcept;

  VirtualThrottleSettings settings_;
  throttle::ThrottlePlant plant_;
  throttle::SensorSampler sensors_;
  std::size_t steps_;
  throttle::ThrottleState state_;
  VirtualThrottleInputs last_{};
  std::int64_t samples_ = 0;
  std::int64_t acting_ = 0;           // faults in `plant_`
  std::int64_t caught_ = 0;           // jams that hold the plate
  std::int64_t received_sample_ = 0;  // 0: none yet
  throttle::SensorReading received_{};
};

}  // namespace mgdd::loop
