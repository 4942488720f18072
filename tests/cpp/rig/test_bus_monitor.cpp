// Error frames: which state of the bus each of them tells, and back.
#include "mgdd/rig/bus_monitor.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string_view>
#include <vector>

namespace mgdd::rig {
namespace {

Frame error(std::uint32_t id, std::uint8_t controller = 0) {
  Frame frame;
  frame.id = id;
  frame.error = true;
  frame.received = true;
  frame.size = 8;
  frame.data[1] = controller;
  return frame;
}

TEST(BusMonitor, FollowsTheStatesOfTheController) {
  BusMonitor monitor;
  EXPECT_EQ(monitor.state(), BusState::active);
  monitor.push(error(0x004, 0x08));
  EXPECT_EQ(monitor.state(), BusState::warning);
  monitor.push(error(0x004, 0x04 | 0x10));
  EXPECT_EQ(monitor.state(), BusState::passive);
  monitor.push(error(0x004, 0x20));
  EXPECT_EQ(monitor.state(), BusState::passive);
  monitor.push(error(0x004, 0x40));
  EXPECT_EQ(monitor.state(), BusState::active);
  monitor.push(error(0x040));
  EXPECT_EQ(monitor.state(), BusState::off);
  monitor.push(error(0x004, 0x10));  // a late word of before
  EXPECT_EQ(monitor.state(), BusState::off);
  monitor.push(error(0x100));
  EXPECT_EQ(monitor.state(), BusState::active);
  monitor.push(error(0x040));
  monitor.push(error(0x004, 0x40));
  EXPECT_EQ(monitor.state(), BusState::active);
  EXPECT_EQ(monitor.counts().error_frames.get(), 9u);
  EXPECT_EQ(monitor.counts().bus_off.get(), 2u);
  EXPECT_EQ(monitor.counts().restarted.get(), 1u);
  EXPECT_EQ(monitor.counts().controller.get(), 6u);
  EXPECT_EQ(monitor.counts().other.get(), 0u);
}

TEST(BusMonitor, CountsTheRestAndLeavesTheStateAlone) {
  BusMonitor monitor;
  for (const std::uint32_t id : {0x001u, 0x002u, 0x008u, 0x010u, 0x020u, 0x080u})
    monitor.push(error(id));
  monitor.push(error(0x004, 0x01));
  monitor.push(error(0x004, 0x02));
  EXPECT_EQ(monitor.state(), BusState::active);
  EXPECT_EQ(monitor.counts().other.get(), 6u);
  EXPECT_EQ(monitor.counts().overflow.get(), 2u);
}

TEST(ErrorClasses, NameEveryBitOfTheFrame) {
  using Names = std::vector<std::string_view>;
  EXPECT_EQ(error_classes(error(0x001)), Names{"transmit_timeout"});
  EXPECT_EQ(error_classes(error(0x010)), Names{"transceiver"});
  EXPECT_EQ(error_classes(error(0x1A2)), (Names{"lost_arbitration", "no_acknowledgement", "bus_error", "restarted"}));
  EXPECT_EQ(error_classes(error(0x04C)), (Names{"controller", "protocol", "bus_off"}));
  EXPECT_EQ(error_classes(error(0x200)), Names{"unknown"});
}

// Whether a controller is passive stands in its data, and there alone.
TEST(ErrorClasses, AgreeWithTheMonitorOnAPassiveController) {
  for (unsigned flags = 0; flags < 256; ++flags) {
    BusMonitor monitor;
    monitor.push(error(0x004, static_cast<std::uint8_t>(flags)));
    const auto names = error_classes(error(0x004, static_cast<std::uint8_t>(flags)));
    EXPECT_EQ(names.front(), "controller");
    EXPECT_EQ(names.back() == "error_passive", monitor.state() == BusState::passive) << flags;
  }
  Frame empty = error(0x004, 0x10);
  empty.size = 1;
  EXPECT_EQ(error_classes(empty), std::vector<std::string_view>{"controller"});
  EXPECT_EQ(error_classes(error(0x008, 0x10)), std::vector<std::string_view>{"protocol"});
}

TEST(BusMonitor, IgnoresFramesOfSendersAndBrokenOnes) {
  BusMonitor monitor;
  Frame data = error(0x040);
  data.error = false;
  monitor.push(data);
  EXPECT_EQ(monitor.state(), BusState::active);
  EXPECT_EQ(monitor.counts().error_frames.get(), 0u);
  Frame empty = error(0x004, 0x10);
  empty.size = 0;
  monitor.push(empty);
  EXPECT_EQ(monitor.state(), BusState::active);
}

}  // namespace
}  // namespace mgdd::rig
