// A bus behind two rings: one thread (of Python, for any python-can interface) feeds and drains them, the loop takes
// and gives frames without waiting. The ring towards the bus is short, so that no command leaves late. All calls but
// the constructor are real-time safe.
#pragma once

#include <atomic>
#include <cstddef>

#include "mgdd/rig/spsc_ring.hpp"
#include "mgdd/rig/transport.hpp"

namespace mgdd::rig {

class RingTransport {
 public:
  /// ParameterError unless both are powers of two.
  explicit RingTransport(std::size_t receive_capacity = 1024, std::size_t send_capacity = 16);

  // The loop's side.
  bool receive(Frame& frame) noexcept;
  SendResult send(const Frame& frame) noexcept;
  [[nodiscard]] BusState bus_state() const noexcept;
  [[nodiscard]] const TransportCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] const BusMonitor& monitor() const noexcept { return monitor_; }
  Claim& claim() noexcept { return claim_; }

  // The bus's side: one thread feeds, one takes.
  /// A frame from the bus, with its stamps; false, and counted as lost, where the loop left no room.
  bool feed(const Frame& frame) noexcept;
  /// The next frame to send, if any.
  bool take(Frame& frame) noexcept { return to_bus_.pop(frame); }
  /// The bus is gone, for good: the loop sees it as bus-off and sends nothing more.
  void fail() noexcept { failed_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] std::size_t waiting_to_send() const noexcept { return to_bus_.size(); }
  [[nodiscard]] std::size_t waiting_for_loop() const noexcept { return from_bus_.size(); }

 private:
  SpscRing<Frame> from_bus_, to_bus_;
  Claim claim_;
  TransportCounts counts_;
  BusMonitor monitor_;
  std::atomic<bool> failed_{false};
};

static_assert(Transport<RingTransport>);

}  // namespace mgdd::rig
