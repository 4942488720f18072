#include "mgdd/loop/virtual_throttle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/throttle/simulation.hpp"

namespace mgdd::loop {
namespace {

constexpr double most_faults = 32.0;  // bits of a mask that is exact as a double
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void validate(const VirtualThrottleSettings& s) {
  validate(s.throttle);
  validate(s.sensors);
  for (const throttle::SensorFault& fault : s.faults)
    validate(fault);
  for (const ThrottleFault& fault : s.plant_faults)
    validate(fault);
  require_within("number of faults", static_cast<double>(s.plant_faults.size()), 0.0, most_faults);
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

VirtualThrottleInputs taken(const VirtualThrottleInputs& now, const VirtualThrottleInputs& last) noexcept {
  return {finite_or(now.duty, last.duty), finite_or(now.supply_v, last.supply_v),
          finite_or(now.airflow_torque_nm, last.airflow_torque_nm), now.bridge_open};
}

VirtualThrottleSample sample_of(const throttle::ThrottleState& state, double angle_deg) noexcept {
  VirtualThrottleSample out;
  out.angle_deg = angle_deg;
  out.speed_deg_per_s = state.plate_speed_rad_per_s / units::rad_per_deg;
  out.current_a = state.current_a;
  return out;
}

VirtualThrottle::VirtualThrottle(const VirtualThrottleSettings& settings)
    : settings_(checked(settings)),
      plant_(settings.throttle, settings.step_s),
      sensors_(settings.sensors, settings.sample_s, settings.seed, settings.faults),
      steps_(throttle::steps_per_sample(settings.sample_s, settings.step_s)),
      state_(throttle::at_rest(settings.start_deg)) {
  last_.supply_v = settings.throttle.supply_v;
}

std::int64_t VirtualThrottle::acting() const noexcept {
  std::int64_t mask = 0;
  for (std::size_t i = 0; i < settings_.plant_faults.size(); ++i) {
    const ThrottleFault& fault = settings_.plant_faults[i];
    const std::int64_t bit = std::int64_t{1} << i;
    const bool waits = fault.kind == ThrottleFaultKind::jammed_at && (caught_ & bit) == 0;
    if (!waits && samples_of(fault, settings_.sample_s).contains(samples_)) mask |= bit;
  }
  return mask;
}

void VirtualThrottle::use(std::int64_t faults) noexcept {
  if (faults == acting_) return;
  acting_ = faults;
  throttle::Throttle now = settings_.throttle;
  for (std::size_t i = 0; i < settings_.plant_faults.size(); ++i) {
    if ((faults >> i & 1) != 0) apply(settings_.plant_faults[i], now);
  }
  plant_ = {throttle::plant_coefficients(now, settings_.step_s), now, settings_.step_s};
}

void VirtualThrottle::catch_plate(double from_deg, double to_deg) noexcept {
  for (std::size_t i = 0; i < settings_.plant_faults.size(); ++i) {
    const ThrottleFault& fault = settings_.plant_faults[i];
    if (fault.kind != ThrottleFaultKind::jammed_at) continue;
    if (!samples_of(fault, settings_.sample_s).contains(samples_)) continue;
    if ((from_deg - fault.size) * (to_deg - fault.size) <= 0.0) caught_ |= std::int64_t{1} << i;
  }
}

// What the controller gets of the sample; `samples_` has not yet counted it.
void VirtualThrottle::transmit(VirtualThrottleSample& out) noexcept {
  const auto hit_by = [&](ThrottleFaultKind kind) {
    return std::ranges::any_of(settings_.plant_faults, [&](const ThrottleFault& fault) {
      return fault.kind == kind && samples_of(fault, settings_.sample_s).contains(samples_);
    });
  };
  const bool missing = hit_by(ThrottleFaultKind::missing_sample), stale = hit_by(ThrottleFaultKind::stale_sample);
  const bool invalid = hit_by(ThrottleFaultKind::nan_sample);
  const bool arrives = !missing && !stale;
  if (stale) out.sensed = received_;
  if (arrives && !invalid) {
    received_sample_ = samples_ + 1;
    received_ = out.sensed;
  }
  if (missing || invalid || received_sample_ == 0) {
    out.sensed = received_;
    out.sensed.volts.fill(nan);
    out.sensed.angle_deg = out.sensed.sum_error_v = nan;
  }
  out.age_s = arrives ? 0.0 : static_cast<double>(samples_ + 1 - received_sample_) * settings_.sample_s;
}

VirtualThrottleSample VirtualThrottle::step(const VirtualThrottleInputs& inputs) noexcept {
  last_ = taken(inputs, last_);
  throttle::ThrottleInput in{.duty = last_.bridge_open ? 0.0 : last_.duty,
                             .supply_v = last_.supply_v,
                             .airflow_torque_nm = last_.airflow_torque_nm,
                             .bridge = last_.bridge_open ? throttle::Bridge::open : settings_.bridge};
  for (const ThrottleFault& fault : settings_.plant_faults) {
    if (fault.kind == ThrottleFaultKind::supply_sag && samples_of(fault, settings_.sample_s).contains(samples_)) {
      in.supply_v = std::min(in.supply_v, fault.size);
    }
  }
  const bool whole = settings_.plant_faults.empty();
  for (std::size_t i = 0; i < steps_; ++i) {
    const double before_deg = plant_.output(state_);
    if (!whole) use(acting());
    plant_.step(state_, in);
    if (!whole) catch_plate(before_deg, plant_.output(state_));
  }
  VirtualThrottleSample out = sample_of(state_, plant_.output(state_));
  out.sample = samples_ + 1;
  out.supply_v = in.supply_v;
  out.sensed = sensors_.step(out.angle_deg);
  if (!whole) transmit(out);
  ++samples_;
  return out;
}

}  // namespace mgdd::loop
