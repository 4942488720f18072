#include "mgdd/loop/virtual_throttle.hpp"

#include <cmath>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/throttle/simulation.hpp"

namespace mgdd::loop {

void validate(const VirtualThrottleSettings& s) {
  validate(s.throttle);
  validate(s.sensors);
  for (const throttle::SensorFault& fault : s.faults)
    validate(fault);
  (void)throttle::steps_per_sample(s.sample_s, s.step_s);
  require_within("start_deg", s.start_deg, s.throttle.closed_deg, s.throttle.open_deg, "deg");
}

namespace {

const VirtualThrottleSettings& checked(const VirtualThrottleSettings& settings) {
  validate(settings);
  return settings;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

double finite_or(double value, double otherwise) noexcept {
  return std::isfinite(value) ? value : otherwise;
}

}  // namespace

VirtualThrottle::VirtualThrottle(const VirtualThrottleSettings& settings)
    : settings_(checked(settings)),
      plant_(settings.throttle, settings.step_s),
      sensors_(settings.sensors, settings.sample_s, settings.seed, settings.faults),
      steps_(throttle::steps_per_sample(settings.sample_s, settings.step_s)),
      state_(throttle::at_rest(settings.start_deg)) {
  last_.supply_v = settings.throttle.supply_v;
}

VirtualThrottleSample VirtualThrottle::step(const VirtualThrottleInputs& inputs) noexcept {
  last_ = {finite_or(inputs.duty, last_.duty), finite_or(inputs.supply_v, last_.supply_v),
           finite_or(inputs.airflow_torque_nm, last_.airflow_torque_nm)};
  const throttle::ThrottleInput in{.duty = last_.duty,
                                   .supply_v = last_.supply_v,
                                   .airflow_torque_nm = last_.airflow_torque_nm,
                                   .bridge = settings_.bridge};
  for (std::size_t i = 0; i < steps_; ++i)
    plant_.step(state_, in);
  ++samples_;
  VirtualThrottleSample out;
  out.sample = samples_;
  out.angle_deg = plant_.output(state_);
  out.speed_deg_per_s = state_.plate_speed_rad_per_s / units::rad_per_deg;
  out.current_a = state_.current_a;
  out.sensed = sensors_.step(out.angle_deg);
  return out;
}

}  // namespace mgdd::loop
