#include "mgdd/loop/virtual_throttle_lanes.hpp"

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/throttle/simulation.hpp"

namespace mgdd::loop {
namespace {

std::span<const VirtualThrottleSettings> checked(std::span<const VirtualThrottleSettings> all) {
  require_within("number of throttles", static_cast<double>(all.size()), 1.0,
                 static_cast<double>(VirtualThrottleLanes::width));
  for (const VirtualThrottleSettings& one : all) {
    validate(one);
    if (!side_by_side(one, all[0])) {
      throw ParameterError(
          "throttles side by side must be alike in sample_s, step_s, bridge, friction and backlash, and without "
          "faults");
    }
  }
  return all;
}

throttle::PlantLanes plants_of(std::span<const VirtualThrottleSettings> all) {
  std::vector<throttle::ThrottleCase> cases;
  for (const VirtualThrottleSettings& one : all)
    cases.push_back({one.throttle, throttle::at_rest(one.start_deg)});
  return {cases, all[0].step_s};
}

}  // namespace

bool side_by_side(const VirtualThrottleSettings& one, const VirtualThrottleSettings& other) noexcept {
  return one.plant_faults.empty() && other.plant_faults.empty() && one.sample_s == other.sample_s &&
         one.step_s == other.step_s && one.bridge == other.bridge && same_form(one.throttle, other.throttle);
}

VirtualThrottleLanes::VirtualThrottleLanes(std::span<const VirtualThrottleSettings> settings)
    : plants_(plants_of(checked(settings))),
      bridge_(settings[0].bridge),
      steps_(throttle::steps_per_sample(settings[0].sample_s, settings[0].step_s)) {
  for (const VirtualThrottleSettings& one : settings) {
    sensors_.emplace_back(one.sensors, one.sample_s, one.seed, one.faults);
    last_.push_back({.supply_v = one.throttle.supply_v});
  }
}

void VirtualThrottleLanes::step(std::span<const VirtualThrottleInputs> inputs,
                                std::span<VirtualThrottleSample> out) noexcept {
  throttle::PlantLanes::Inputs in{.bridge = bridge_};
  for (std::size_t lane = 0; lane < size(); ++lane) {
    const VirtualThrottleInputs& now = last_[lane] = taken(inputs[lane], last_[lane]);
    in.duty[lane] = now.duty;
    in.supply_v[lane] = now.supply_v;
    in.airflow_torque_nm[lane] = now.airflow_torque_nm;
  }
  plants_.step(in, steps_);
  ++samples_;
  for (std::size_t lane = 0; lane < size(); ++lane) {
    out[lane] = sample_of(plants_.state(lane), plants_.angle_deg(lane));
    out[lane].sample = samples_;
    out[lane].supply_v = in.supply_v[lane];
    out[lane].sensed = sensors_[lane].step(out[lane].angle_deg);
  }
}

}  // namespace mgdd::loop
