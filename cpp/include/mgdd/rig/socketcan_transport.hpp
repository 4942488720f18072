// A CAN interface of Linux as a raw socket that never blocks: frames with the kernel's stamps, error frames, frames
// that the kernel dropped. Sending tries again for a bounded time where the queue of the interface is full; keep that
// queue short (`txqueuelen`), or old commands leave late. Opening is offline code; `receive` and `send` are real-time
// safe. Elsewhere than on Linux, and where the kernel has no CAN, opening is refused.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mgdd/rig/transport.hpp"

namespace mgdd::rig {

/// Lets a frame pass whose identifier agrees with `id` in the bits of `mask`.
struct CanFilter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0x7FF;
  bool extended = false;
};

struct SocketCanSettings {
  std::string interface = "can0";
  bool fd = false;                       ///< CAN FD frames too
  std::vector<CanFilter> filters{};      ///< set before the first frame can arrive; none: all frames
  int receive_buffer_bytes = 4'194'304;  ///< asked for; 300 frames and more per 128 kB
  double send_patience_s = 2e-4;         ///< for room in the queue, 0 to 0.1
};
/// ParameterError naming field, value and bound.
void validate(const SocketCanSettings& settings);

class SocketCanTransport {
 public:
  /// ParameterError for bad settings; RigError where the kernel has no CAN, or the interface does not exist, is down,
  /// is of another type or cannot do CAN FD.
  explicit SocketCanTransport(const SocketCanSettings& settings);
  /// Takes over an open socket that carries `struct can_frame`, and closes it in the end.
  SocketCanTransport(int descriptor, const SocketCanSettings& settings);
  SocketCanTransport(const SocketCanTransport&) = delete;
  SocketCanTransport& operator=(const SocketCanTransport&) = delete;
  ~SocketCanTransport();

  /// The stamp on the monotonic clock is the kernel's, as old as it was when the frame was fetched; it is never older
  /// than the last time at which nothing waited, so a step of the wall clock does no harm.
  bool receive(Frame& frame) noexcept;
  SendResult send(const Frame& frame) noexcept;
  /// Off too while the interface is down or gone.
  [[nodiscard]] BusState bus_state() const noexcept;
  [[nodiscard]] const TransportCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] const BusMonitor& monitor() const noexcept { return monitor_; }
  Claim& claim() noexcept { return claim_; }

  /// Bytes that the kernel granted; it counts its own book-keeping too.
  [[nodiscard]] int receive_buffer_bytes() const noexcept { return receive_buffer_bytes_; }
  [[nodiscard]] const SocketCanSettings& settings() const noexcept { return settings_; }

 private:
  void prepare();
  void note_failure(int error) noexcept;

  SocketCanSettings settings_;
  Claim claim_;
  int descriptor_ = -1;
  int receive_buffer_bytes_ = 0;
  std::uint32_t dropped_by_kernel_ = 0;
  std::int64_t empty_ns_ = 0;  // when nothing waited last
  TransportCounts counts_;
  BusMonitor monitor_;
  std::atomic<bool> down_{false};
};

static_assert(Transport<SocketCanTransport>);

}  // namespace mgdd::rig
