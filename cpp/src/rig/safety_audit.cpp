#include "mgdd/rig/safety_audit.hpp"

#include <string_view>

#include "mgdd/common/error.hpp"

namespace mgdd::rig {
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
