// Audit list of a safety gate: every change of its state in a queue of fixed size that the loop empties. A full queue
// keeps the older entries, which tell how it began, and counts those it had no room for. noexcept, heap-free.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/state.hpp"

namespace mgdd::rig {

enum class SafetyState {
  init,   ///< as made, or after the reset of a fault: nothing is known
  armed,  ///< measurements are healthy; not driven yet
  run,    ///< the only state in which the actuator is driven
  limp,   ///< bridge open; a reset leads to `armed`
  fault,  ///< bridge open; a reset leads to `init`
};

/// Why a state was entered, or what stands against a request.
enum class SafetyReason {
  none,
  requested,       ///< the operator asked for it
  wrong_state,     ///< a request that this state does not have
  too_few_frames,  ///< nothing is wrong, but not for long enough
  // To LIMP.
  aborted,     ///< an exception, a signal or a contact asked for the safe state
  stale,       ///< no good frame for too long
  bad_frames,  ///< wrong checksum, length or counter
  bus_fault,
  not_sent,      ///< commands do not leave
  deadlines,     ///< missed in a row
  not_observed,  ///< a duty without facts before it
  heat,
  stall,
  // To FAULT.
  sensor_range,
  sensor_disagreement,
  sensor_slope,
  travel,        ///< the plate is where it cannot be
  invalid_duty,  ///< not finite
};
inline constexpr std::size_t n_safety_states = names<SafetyState>().size();
inline constexpr std::size_t n_safety_reasons = names<SafetyReason>().size();

constexpr bool is_fault(SafetyReason reason) noexcept {
  return reason >= SafetyReason::sensor_range;
}

/// A change of state.
struct AuditEntry {
  std::int64_t cycle = 0;  ///< of the gate
  SafetyState from = SafetyState::init, to = SafetyState::init;
  SafetyReason reason = SafetyReason::none;
  std::int64_t count = 0;  ///< of changes for this reason so far, this one included

  bool operator==(const AuditEntry&) const = default;
};

class SafetyAudit {
 public:
  static constexpr std::size_t capacity = 64;

  void push(const AuditEntry& entry) noexcept {
    if (size_ == capacity) {
      ++dropped_;
      return;
    }
    entries_[(first_ + size_++) % capacity] = entry;
  }
  /// Takes the oldest entry out.
  std::optional<AuditEntry> pop() noexcept {
    if (size_ == 0) return std::nullopt;
    const AuditEntry entry = entries_[first_];
    first_ = (first_ + 1) % capacity;
    --size_;
    return entry;
  }
  std::size_t size() const noexcept { return size_; }
  /// Entries that found no room, so far.
  std::int64_t dropped() const noexcept { return dropped_; }

  /// The waiting entries, oldest first.
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    constexpr bool reads = !std::is_const_v<Self>;
    std::array<std::array<double, capacity>, 5> columns{};
    auto size = static_cast<std::int64_t>(self.size_);  // NOLINT(misc-const-correctness): a reader writes it
    for (std::size_t i = 0; i < self.size_; ++i) {
      const AuditEntry& e = self.entries_[(self.first_ + i) % capacity];
      const std::array<double, 5> row{static_cast<double>(e.cycle), static_cast<double>(e.from),
                                      static_cast<double>(e.to), static_cast<double>(e.reason),
                                      static_cast<double>(e.count)};
      for (std::size_t c = 0; c < row.size(); ++c)
        columns[c][i] = row[c];
    }
    v("audit_size", size, static_cast<std::int64_t>(capacity) + 1);
    v("audit_dropped", self.dropped_, counts_end);
    v("audit_cycle", columns[0]);
    v("audit_from", columns[1]);
    v("audit_to", columns[2]);
    v("audit_reason", columns[3]);
    v("audit_count", columns[4]);
    if constexpr (reads) {
      self.first_ = 0;
      self.size_ = static_cast<std::size_t>(size);
      for (std::size_t i = 0; i < self.size_; ++i)
        self.entries_[i] = entry_of(columns[0][i], columns[1][i], columns[2][i], columns[3][i], columns[4][i]);
    }
  }

 private:
  /// ParameterError for numbers that no entry has.
  static AuditEntry entry_of(double cycle, double from, double to, double reason, double count);

  std::array<AuditEntry, capacity> entries_{};
  std::size_t first_ = 0, size_ = 0;
  std::int64_t dropped_ = 0;
};

}  // namespace mgdd::rig
