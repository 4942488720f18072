#include "mgdd/loop/transport_lag.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/record.hpp"

namespace mgdd::loop {
namespace {

// Four-stroke: one cycle lasts 120 / N seconds.
double cycles(double time_s, double speed_rpm) noexcept {
  return time_s * speed_rpm / 120.0;
}

}  // namespace

std::size_t SensorDynamics::delay_at(double speed_rpm) const noexcept {
  if (delay_cycles) return static_cast<std::size_t>(*delay_cycles);
  return static_cast<std::size_t>(std::round(cycles(delay_s, speed_rpm)));
}

double SensorDynamics::gain_at(double speed_rpm) const noexcept {
  const double tau = lag_cycles ? *lag_cycles : cycles(lag_s, speed_rpm);
  return tau > 0.0 ? -std::expm1(-1.0 / tau) : 1.0;
}

void validate(std::string_view sensor, const SensorDynamics& d) {
  try {
    require_fields(fields_of(d), d);
  } catch (const ParameterError& error) {
    throw within(sensor, error);
  }
}

void TransportLag::fill(double steady) noexcept {
  std::fill(line_.begin(), line_.end(), steady);
  level_ = steady;
}

double TransportLag::step(double x, std::size_t delay, double gain) noexcept {
  const std::size_t n = line_.size();
  const auto at = static_cast<std::size_t>(at_) + 1 < n ? static_cast<std::size_t>(at_) + 1 : 0;
  at_ = static_cast<std::int64_t>(at);
  line_[at] = x;
  const double inlet = line_[at >= delay ? at - delay : at + n - delay];
  level_ = gain < 1.0 ? level_ + gain * (inlet - level_) : inlet;
  return level_;
}

}  // namespace mgdd::loop
