#include "mgdd/rig/safety_audit.hpp"

#include <string_view>
#include <utility>

#include "mgdd/common/error.hpp"

namespace mgdd::rig {
namespace {

constexpr std::array<std::pair<SafetyState, std::string_view>, n_safety_states> states{{{SafetyState::init, "init"},
                                                                                        {SafetyState::armed, "armed"},
                                                                                        {SafetyState::run, "run"},
                                                                                        {SafetyState::limp, "limp"},
                                                                                        {SafetyState::fault, "fault"}}};

constexpr std::array<std::pair<SafetyReason, std::string_view>, n_safety_reasons> reasons{
    {{SafetyReason::none, "none"},
     {SafetyReason::requested, "requested"},
     {SafetyReason::wrong_state, "wrong_state"},
     {SafetyReason::too_few_frames, "too_few_frames"},
     {SafetyReason::aborted, "aborted"},
     {SafetyReason::stale, "stale"},
     {SafetyReason::bad_frames, "bad_frames"},
     {SafetyReason::bus_fault, "bus_fault"},
     {SafetyReason::not_sent, "not_sent"},
     {SafetyReason::deadlines, "deadlines"},
     {SafetyReason::not_observed, "not_observed"},
     {SafetyReason::heat, "heat"},
     {SafetyReason::stall, "stall"},
     {SafetyReason::sensor_range, "sensor_range"},
     {SafetyReason::sensor_disagreement, "sensor_disagreement"},
     {SafetyReason::sensor_slope, "sensor_slope"},
     {SafetyReason::travel, "travel"},
     {SafetyReason::invalid_duty, "invalid_duty"}}};

}  // namespace

Names<SafetyState> safety_state_names() noexcept {
  return states;
}
Names<SafetyReason> safety_reason_names() noexcept {
  return reasons;
}

AuditEntry SafetyAudit::entry_of(double cycle, double from, double to, double reason, double count) {
  const auto below = [](double value, std::size_t end) { return value >= 0.0 && value < static_cast<double>(end); };
  if (!below(from, n_safety_states) || !below(to, n_safety_states) || !below(reason, n_safety_reasons)) {
    throw ParameterError("state columns 'audit_from', 'audit_to' and 'audit_reason' hold " + text(from) + ", " +
                         text(to) + " and " + text(reason) + ": must be states and a reason of a gate");
  }
  return {static_cast<std::int64_t>(cycle), static_cast<SafetyState>(static_cast<int>(from)),
          static_cast<SafetyState>(static_cast<int>(to)), static_cast<SafetyReason>(static_cast<int>(reason)),
          static_cast<std::int64_t>(count)};
}

}  // namespace mgdd::rig
