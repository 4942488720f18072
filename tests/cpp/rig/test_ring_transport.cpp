// Transport in memory, and the state of a bus.
#include <string_view>
#include <thread>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/bus_monitor.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "mgdd/rig/ring_transport.hpp"
#include "support/test.hpp"

namespace mgdd::rig {
namespace {

Frame numbered(std::uint32_t id, std::uint8_t first) {
  Frame frame;
  frame.id = id;
  frame.size = 3;
  frame.data = {first, 0xA5, 0x5A};
  return frame;
}

TEST(RingTransport, FramesPassBothWaysWithTheirStamps) {
  RingTransport bus(8, 4);
  Frame stamped = numbered(0x121, 7);
  stamped.monotonic_ns = 1'234;
  stamped.bus_ns = 99;
  EXPECT_TRUE(bus.feed(stamped));
  EXPECT_TRUE(bus.feed(numbered(0x122, 8)));
  Frame got;
  ASSERT_TRUE(bus.receive(got));
  EXPECT_EQ(got.id, 0x121u);
  EXPECT_EQ(got.monotonic_ns, 1'234);
  EXPECT_EQ(got.bus_ns, 99);
  EXPECT_TRUE(got.received);
  const std::int64_t before = monotonic_ns();
  ASSERT_TRUE(bus.receive(got));
  EXPECT_GT(got.monotonic_ns, 0);
  EXPECT_LE(got.monotonic_ns, before);
  EXPECT_FALSE(bus.receive(got));

  Frame command = numbered(0x120, 1);
  command.received = true;
  EXPECT_EQ(bus.send(command), SendResult::sent);
  EXPECT_EQ(bus.waiting_to_send(), 1u);
  ASSERT_TRUE(bus.take(got));
  EXPECT_EQ(got.id, 0x120u);
  EXPECT_EQ(got.data[1], 0xA5);
  EXPECT_FALSE(got.received);
  EXPECT_GE(got.monotonic_ns, before);
  EXPECT_FALSE(bus.take(got));
  EXPECT_EQ(bus.counts().received.get(), 2u);
  EXPECT_EQ(bus.counts().sent.get(), 1u);
}

TEST(RingTransport, CountsWhatFindsNoRoom) {
  RingTransport bus(2, 2);
  for (std::uint8_t i = 0; i < 5; ++i)
    bus.feed(numbered(1, i));
  EXPECT_EQ(bus.counts().lost.get(), 3u);
  EXPECT_EQ(bus.send(numbered(2, 0)), SendResult::sent);
  EXPECT_EQ(bus.send(numbered(2, 1)), SendResult::sent);
  EXPECT_EQ(bus.send(numbered(2, 2)), SendResult::full);
  EXPECT_EQ(bus.counts().full.get(), 1u);
  EXPECT_THROW(RingTransport(3, 2), ParameterError);
  EXPECT_THROW(RingTransport(4, 0), ParameterError);
}

TEST(RingTransport, ErrorFramesAndADeadBusShowInItsState) {
  RingTransport bus(8, 8);
  Frame off;
  off.error = true;
  off.id = bus_error::bus_off;
  bus.feed(off);
  EXPECT_EQ(bus.bus_state(), BusState::active);  // not taken yet
  Frame got;
  ASSERT_TRUE(bus.receive(got));
  EXPECT_TRUE(got.error);
  EXPECT_EQ(bus.bus_state(), BusState::off);
  off.id = bus_error::restarted;
  bus.feed(off);
  ASSERT_TRUE(bus.receive(got));
  EXPECT_EQ(bus.bus_state(), BusState::active);
  EXPECT_EQ(bus.send(off), SendResult::failed);
  Frame endless = numbered(1, 1);
  endless.size = 65;
  EXPECT_EQ(bus.send(endless), SendResult::failed);
  bus.fail();
  EXPECT_EQ(bus.bus_state(), BusState::off);
  EXPECT_EQ(bus.send(numbered(1, 1)), SendResult::failed);
  EXPECT_EQ(bus.counts().failed.get(), 3u);
}

TEST(RingTransport, TwoThreadsEchoEveryFrame) {
  RingTransport bus(16, 16);
  constexpr std::uint32_t n = 20'000;
  const std::jthread other([&] {
    Frame frame;
    for (std::uint32_t echoed = 0; echoed < n;) {
      if (bus.waiting_to_send() > 0 && bus.take(frame)) {
        while (!bus.feed(frame))
          std::this_thread::yield();
        ++echoed;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint32_t sent = 0, back = 0, wrong = 0;
  Frame frame;
  while (back < n) {
    if (sent < n && bus.send(numbered(sent, static_cast<std::uint8_t>(sent))) == SendResult::sent) ++sent;
    while (bus.receive(frame)) {
      wrong += frame.id == back && frame.data[0] == static_cast<std::uint8_t>(back) ? 0u : 1u;
      ++back;
    }
    std::this_thread::yield();
  }
  EXPECT_EQ(wrong, 0u);
}

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
