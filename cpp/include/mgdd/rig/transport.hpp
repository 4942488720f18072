// What a loop needs of a bus: the next frame that waits, a frame sent at once or not at all, and the state of the bus.
// Both calls are real-time safe and never wait longer than the transport's own bound.
#pragma once

#include <atomic>
#include <concepts>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/rig/bus_monitor.hpp"
#include "mgdd/rig/frame.hpp"
#include "mgdd/rig/shared_count.hpp"

namespace mgdd::rig {

enum class SendResult {
  sent,
  full,    ///< no room within the time that the transport allows; nothing was sent
  failed,  ///< the frame cannot be sent, or the interface is gone
};

/// One thread writes, any thread reads.
struct TransportCounts {
  SharedCount received;  ///< frames, those of errors included
  SharedCount sent;
  SharedCount lost;     ///< received frames that found no room before the loop took them
  SharedCount retries;  ///< further tries to send a frame that found no room
  SharedCount full, failed;
};

/// Who a transport serves: one loop at a time.
class Claim {
 public:
  /// False where it is taken.
  bool take() noexcept { return !taken_.test_and_set(std::memory_order_acquire); }
  void give_back() noexcept { taken_.clear(std::memory_order_release); }
  [[nodiscard]] bool taken() const noexcept { return taken_.test(std::memory_order_relaxed); }

 private:
  std::atomic_flag taken_{};
};

template <class T>
concept Transport = requires(T& transport, const T& seen, Frame& frame, const Frame& outgoing) {
  { transport.receive(frame) } noexcept -> std::same_as<bool>;  // error frames too
  { transport.send(outgoing) } noexcept -> std::same_as<SendResult>;
  { transport.claim() } noexcept -> std::same_as<Claim&>;
  { seen.bus_state() } noexcept -> std::same_as<BusState>;
  { seen.counts() } noexcept -> std::same_as<const TransportCounts&>;
  { seen.monitor() } noexcept -> std::same_as<const BusMonitor&>;
};

}  // namespace mgdd::rig
