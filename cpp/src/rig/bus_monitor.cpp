#include "mgdd/rig/bus_monitor.hpp"

namespace mgdd::rig {

void BusMonitor::push(const Frame& frame) noexcept {
  namespace e = bus_error;
  if (!frame.error) return;
  counts_.error_frames.add();
  const std::uint32_t known = e::bus_off | e::restarted | e::controller;
  if ((frame.id & ~known) != 0) counts_.other.add();
  BusState next = state();
  if ((frame.id & e::restarted) != 0) {
    counts_.restarted.add();
    next = BusState::active;
  }
  if ((frame.id & e::controller) != 0) {
    counts_.controller.add();
    const unsigned flags = frame.payload().size() > 1 ? frame.data[1] : 0u;
    if ((flags & (e::receive_overflow | e::transmit_overflow)) != 0) counts_.overflow.add();
    if ((flags & e::active_again) != 0) next = BusState::active;
    if (next != BusState::off && (flags & (e::receive_warning | e::transmit_warning)) != 0) next = BusState::warning;
    if (next != BusState::off && (flags & (e::receive_passive | e::transmit_passive)) != 0) next = BusState::passive;
  }
  if ((frame.id & e::bus_off) != 0) {
    counts_.bus_off.add();
    next = BusState::off;
  }
  state_.store(next, std::memory_order_relaxed);
}

}  // namespace mgdd::rig
