// What the error frames of a CAN controller say: its error state, counted by kind, and their classes by name. Codes as
// Linux delivers them (include/uapi/linux/can/error.h), which python-can passes on from any adapter that gives them.
// The monitor is real-time safe, one thread pushes, any thread reads; the names are offline code.
#pragma once

#include <atomic>
#include <cstdint>
#include <string_view>
#include <vector>

#include "mgdd/rig/frame.hpp"
#include "mgdd/rig/safety_envelope.hpp"
#include "mgdd/rig/shared_count.hpp"

namespace mgdd::rig {

/// Class bits in the identifier of an error frame.
namespace bus_error {
inline constexpr std::uint32_t transmit_timeout = 0x001, lost_arbitration = 0x002, controller = 0x004, protocol = 0x008,
                               transceiver = 0x010, no_acknowledgement = 0x020, bus_off = 0x040, bus = 0x080,
                               restarted = 0x100;
/// Bits of `data[1]` of the class `controller`.
inline constexpr std::uint8_t receive_overflow = 0x01, transmit_overflow = 0x02, receive_warning = 0x04,
                              transmit_warning = 0x08, receive_passive = 0x10, transmit_passive = 0x20,
                              active_again = 0x40;
}  // namespace bus_error

/// Names of the class bits of an error frame, lowest first; "error_passive" last where its data say that the controller
/// is, "unknown" where no bit is known.
[[nodiscard]] std::vector<std::string_view> error_classes(const Frame& frame);

class BusMonitor {
 public:
  /// Ignores all but error frames.
  void push(const Frame& frame) noexcept;

  /// From bus-off a controller comes back when it says that it was restarted, or is active again.
  [[nodiscard]] BusState state() const noexcept { return state_.load(std::memory_order_relaxed); }

  struct Counts {
    SharedCount error_frames, bus_off, restarted, controller, overflow, other;
  };
  [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

 private:
  std::atomic<BusState> state_{BusState::active};
  Counts counts_;
};

}  // namespace mgdd::rig
