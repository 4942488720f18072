#include "mgdd/rig/bus_monitor.hpp"

#include <string_view>
#include <utility>

namespace mgdd::rig {
namespace {

namespace e = bus_error;

constexpr std::pair<std::uint32_t, std::string_view> classes[] = {{e::transmit_timeout, "transmit_timeout"},
                                                                  {e::lost_arbitration, "lost_arbitration"},
                                                                  {e::controller, "controller"},
                                                                  {e::protocol, "protocol"},
                                                                  {e::transceiver, "transceiver"},
                                                                  {e::no_acknowledgement, "no_acknowledgement"},
                                                                  {e::bus_off, "bus_off"},
                                                                  {e::bus, "bus_error"},
                                                                  {e::restarted, "restarted"}};

// Bits that a controller error has in its data; 0 for another one, or a frame without them.
unsigned controller_flags(const Frame& frame) noexcept {
  return (frame.id & e::controller) != 0 && frame.payload().size() > 1 ? frame.data[1] : 0u;
}

bool is_passive(unsigned flags) noexcept {
  return (flags & (e::receive_passive | e::transmit_passive)) != 0;
}

}  // namespace

std::vector<std::string_view> error_classes(const Frame& frame) {
  std::vector<std::string_view> out;
  for (const auto& [bit, name] : classes) {
    if ((frame.id & bit) != 0) out.push_back(name);
  }
  if (is_passive(controller_flags(frame))) out.emplace_back("error_passive");
  if (out.empty()) out.emplace_back("unknown");
  return out;
}

void BusMonitor::push(const Frame& frame) noexcept {
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
    const unsigned flags = controller_flags(frame);
    if ((flags & (e::receive_overflow | e::transmit_overflow)) != 0) counts_.overflow.add();
    if ((flags & e::active_again) != 0) next = BusState::active;
    if (next != BusState::off && (flags & (e::receive_warning | e::transmit_warning)) != 0) next = BusState::warning;
    if (next != BusState::off && is_passive(flags)) next = BusState::passive;
  }
  if ((frame.id & e::bus_off) != 0) {
    counts_.bus_off.add();
    next = BusState::off;
  }
  state_.store(next, std::memory_order_relaxed);
}

}  // namespace mgdd::rig
