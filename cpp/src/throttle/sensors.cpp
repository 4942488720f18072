#include "mgdd/throttle/sensors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/control/monitoring.hpp"

namespace mgdd::throttle {
void validate(const SensorPair& p) {
  require_fields(fields_of(p), p);
  require_within("closed_v", p.closed_v, 0.0, p.supply_v, "V");
  if (!(p.closed_v + p.span_v <= p.supply_v)) {
    throw ParameterError("span_v", p.span_v, "closed_v + span_v must be <= supply_v = " + text(p.supply_v) + " V", "V");
  }
  for (const auto& [name, volts] :
       {std::pair{"noise_v", p.noise_v}, std::pair{"sum_tolerance_v", p.sum_tolerance_v}, std::pair{"low_v", p.low_v}})
    require_within(name, volts, 0.0, p.supply_v, "V");
  require_within("high_v", p.high_v, p.low_v, p.supply_v, "V");
}

void validate(const SensorFault& fault) {
  require_within("from_s", fault.from_s, 0.0, 1e9, "s");
  if (fault.until_s && !(*fault.until_s > fault.from_s && *fault.until_s <= 1e9)) {
    throw ParameterError("until_s", *fault.until_s, "must be > from_s = " + text(fault.from_s) + " and <= 1e9", "s");
  }
  if (fault.kind == SensorFaultKind::offset) require_within("size", fault.size, -100.0, 100.0, "V");
  if (fault.kind == SensorFaultKind::gain) require_within("size", fault.size, -1.0, 10.0);
}

SensorSampler::SensorSampler(const SensorPair& pair, double sample_s, std::uint64_t seed,
                             const std::array<SensorFault, 2>& faults)
    : pair_(pair), sample_s_(sample_s), seed_(seed), faults_(faults) {
  validate(pair);
  require_within("sample_s", sample_s, 1e-5, 1.0, "s");
  for (const SensorFault& fault : faults)
    validate(fault);
  filter_ = pair.lag_s > 0.0 ? -std::expm1(-sample_s / pair.lag_s) : 1.0;
  lsb_v_ = pair.lsb_v();
  highest_v_ = pair.supply_v - lsb_v_;
  debounce_ = std::max(1.0, std::round(pair.debounce_s / sample_s));
}

double SensorSampler::faulty(std::size_t which, double volts, double time_s) noexcept {
  const SensorFault& fault = faults_[which];
  if (time_s < fault.from_s || (fault.until_s && time_s >= *fault.until_s)) return volts;
  switch (fault.kind) {
    case SensorFaultKind::none:
      return volts;
    case SensorFaultKind::open_wire:
    case SensorFaultKind::short_to_ground:
      return 0.0;
    case SensorFaultKind::short_to_supply:
      return pair_.supply_v;
    case SensorFaultKind::offset:
      return volts + fault.size;
    case SensorFaultKind::gain:
      return volts * (1.0 + fault.size);
    case SensorFaultKind::stuck:
      if (!state_.stuck_v[which]) state_.stuck_v[which] = volts;
      return state_.stuck_v[which].value_or(volts);
  }
  return volts;
}

SensorReading SensorSampler::step(double angle_deg) noexcept {
  const double time_s = static_cast<double>(state_.sample) * sample_s_;
  const double first_v = pair_.closed_v + pair_.span_v * angle_deg / pair_.travel_deg;
  const std::array<double, 2> clean{first_v, pair_.supply_v - first_v};
  SensorReading out;
  for (std::size_t i = 0; i < 2; ++i) {
    const double volts = std::clamp(faulty(i, clean[i], time_s), 0.0, pair_.supply_v);
    double& held = state_.filtered_v[i];
    held = state_.sample == 0 ? volts : held + filter_ * (volts - held);
    const double noise = pair_.noise_v * random::normal(seed_, i, static_cast<std::uint64_t>(state_.sample));
    out.volts[i] = std::clamp(std::round((held + noise) / lsb_v_) * lsb_v_, 0.0, highest_v_);
  }
  out.sum_error_v = out.volts[0] + out.volts[1] - pair_.supply_v;
  const control::PairCheck check =
      control::check_pair(out.volts, closed(pair_.low_v, pair_.high_v), out.sum_error_v, pair_.sum_tolerance_v);
  out.range_fault = {!check.in_range[0], !check.in_range[1]};
  out.sum_fault = !check.agree;
  out.angle_deg = pair_.angles_deg(out.volts)[check.usable()];
  state_.failing = control::leaky(state_.failing, 1.0, !check.healthy(), debounce_);
  state_.fault = state_.fault || state_.failing >= debounce_;
  out.fault = state_.fault;
  ++state_.sample;
  return out;
}

}  // namespace mgdd::throttle
