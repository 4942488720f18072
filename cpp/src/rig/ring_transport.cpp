#include "mgdd/rig/ring_transport.hpp"

#include "mgdd/rig/monotonic_clock.hpp"

namespace mgdd::rig {

RingTransport::RingTransport(std::size_t receive_capacity, std::size_t send_capacity)
    : from_bus_(receive_capacity), to_bus_(send_capacity) {}

bool RingTransport::receive(Frame& frame) noexcept {
  if (!from_bus_.pop(frame)) return false;
  counts_.received.add();
  monitor_.push(frame);
  return true;
}

SendResult RingTransport::send(const Frame& frame) noexcept {
  if (failed_.load(std::memory_order_relaxed) || frame.error || frame.size > max_payload) {
    counts_.failed.add();
    return SendResult::failed;
  }
  Frame stamped = frame;
  stamped.received = false;
  stamped.monotonic_ns = monotonic_ns();
  if (!to_bus_.push(stamped)) {
    counts_.full.add();
    return SendResult::full;
  }
  counts_.sent.add();
  return SendResult::sent;
}

BusState RingTransport::bus_state() const noexcept {
  return failed_.load(std::memory_order_relaxed) ? BusState::off : monitor_.state();
}

bool RingTransport::feed(const Frame& frame) noexcept {
  Frame stamped = frame;
  stamped.received = true;
  if (stamped.monotonic_ns == 0) stamped.monotonic_ns = monotonic_ns();
  if (from_bus_.push(stamped)) return true;
  counts_.lost.add();
  return false;
}

}  // namespace mgdd::rig
