// A bus behind two rings: frames through both ways with their stamps, what finds no room is counted, a dead bus is off.
#include "mgdd/rig/ring_transport.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"

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

}  // namespace
}  // namespace mgdd::rig
