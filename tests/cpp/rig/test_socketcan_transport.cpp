// The raw socket: what is refused when it is opened, and everything that does not need a CAN driver, over a pair of
// datagram sockets that carry the kernel's own frames.
#include "mgdd/rig/socketcan_transport.hpp"

#include <gtest/gtest.h>

#if defined(__linux__) && __has_include(<linux/can/raw.h>)

#include <linux/can.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::rig {
namespace {

struct Line {
  Line() {
    if (socketpair(AF_UNIX, SOCK_DGRAM, 0, ends.data()) != 0) throw RigError("no socket pair");
  }
  ~Line() { close(ends[1]); }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  template <class Raw>
  void write(const Raw& raw, std::size_t bytes) const {
    ASSERT_EQ(::send(ends[1], &raw, bytes, 0), static_cast<ssize_t>(bytes));
  }

  std::array<int, 2> ends{};  // ours is closed by the transport
};

can_frame classic(std::uint32_t id, std::initializer_list<std::uint8_t> data) {
  can_frame raw{};
  raw.can_id = id;
  raw.can_dlc = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), &raw.data[0]);
  return raw;
}

TEST(SocketCanTransport, RefusesBadSettings) {
  EXPECT_THROW(SocketCanTransport({.interface = ""}), ParameterError);
  EXPECT_THROW(SocketCanTransport({.interface = "a_name_of_17_char"}), ParameterError);
  EXPECT_THROW(SocketCanTransport({.receive_buffer_bytes = 0}), ParameterError);
  EXPECT_THROW(SocketCanTransport({.send_patience_s = 1.0}), ParameterError);
  EXPECT_THROW(SocketCanTransport({.filters = {{.id = 0x800}}}), ParameterError);
}

TEST(SocketCanTransport, SaysWhatIsMissing) {
  const int probe = socket(AF_CAN, SOCK_RAW, CAN_RAW);
  const bool without_can = probe < 0;
  if (!without_can) close(probe);
  try {
    const SocketCanTransport transport({.interface = "nosuchcan7"});
    FAIL() << "opened an interface that does not exist";
  } catch (const RigError& error) {
    const std::string text = error.what();
    if (without_can) {
      EXPECT_NE(text.find("this kernel has no CAN sockets"), std::string::npos) << text;
      EXPECT_NE(text.find("RingTransport"), std::string::npos) << text;
    } else {
      EXPECT_NE(text.find("no interface 'nosuchcan7'"), std::string::npos) << text;
    }
  }
}

TEST(SocketCanTransport, ReadsFramesOfEveryKind) {
  const Line line;
  SocketCanTransport transport(line.ends[0], {.fd = true});
  Frame frame;
  EXPECT_FALSE(transport.receive(frame));
  const std::int64_t before = monotonic_ns();
  line.write(classic(0x121, {1, 2, 3}), CAN_MTU);
  line.write(classic(0x1ABCDEF1 | CAN_EFF_FLAG, {9}), CAN_MTU);
  line.write(classic(0x7FF | CAN_RTR_FLAG, {}), CAN_MTU);
  canfd_frame wide{};
  wide.can_id = 0x55;
  wide.len = 12;
  wide.flags = CANFD_BRS;
  wide.data[11] = 77;
  line.write(wide, CANFD_MTU);
  line.write(wide, 10);  // no frame at all

  ASSERT_TRUE(transport.receive(frame));
  EXPECT_EQ(frame.id, 0x121u);
  EXPECT_FALSE(frame.extended || frame.error || frame.remote || frame.fd);
  EXPECT_TRUE(frame.received);
  EXPECT_EQ(frame.size, 3);
  EXPECT_EQ(frame.data[2], 3);
  EXPECT_GE(frame.monotonic_ns, before - 1'000'000);
  EXPECT_LE(frame.monotonic_ns, monotonic_ns());
  EXPECT_GT(frame.bus_ns, std::int64_t{1'500'000'000} * 1'000'000'000);  // the wall clock
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_EQ(frame.id, 0x1ABCDEF1u);
  EXPECT_TRUE(frame.extended);
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_EQ(frame.id, 0x7FFu);
  EXPECT_TRUE(frame.remote);
  EXPECT_EQ(frame.size, 0);
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_TRUE(frame.fd && frame.bit_rate_switch);
  EXPECT_EQ(frame.size, 12);
  EXPECT_EQ(frame.data[11], 77);
  EXPECT_FALSE(transport.receive(frame));
  EXPECT_EQ(transport.counts().received.get(), 4u);
}

TEST(SocketCanTransport, AStampIsTheKernelsAndNotThatOfTheCall) {
  const Line line;
  SocketCanTransport transport(line.ends[0], {});
  Frame frame;
  EXPECT_FALSE(transport.receive(frame));
  const std::int64_t sent = monotonic_ns();
  line.write(classic(1, {}), CAN_MTU);
  sleep_until_ns(sent + 20'000'000);
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_GE(monotonic_ns() - frame.monotonic_ns, 15'000'000);
  EXPECT_GE(frame.monotonic_ns, sent - 1'000'000);
}

TEST(SocketCanTransport, ErrorFramesComeThroughAndSetTheState) {
  const Line line;
  SocketCanTransport transport(line.ends[0], {});
  Frame frame;
  line.write(classic(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_TX_PASSIVE, 0, 0, 0, 0, 0, 0}), CAN_MTU);
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_TRUE(frame.error);
  EXPECT_EQ(frame.id, 0x004u);
  EXPECT_EQ(transport.bus_state(), BusState::passive);
  line.write(classic(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0}), CAN_MTU);
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_EQ(transport.bus_state(), BusState::off);
  line.write(classic(CAN_ERR_FLAG | CAN_ERR_RESTARTED, {0, 0, 0, 0, 0, 0, 0, 0}), CAN_MTU);
  ASSERT_TRUE(transport.receive(frame));
  EXPECT_EQ(transport.bus_state(), BusState::active);
  EXPECT_EQ(transport.monitor().counts().error_frames.get(), 3u);
}

TEST(SocketCanTransport, WritesFramesAsTheKernelReadsThem) {
  const Line line;
  SocketCanTransport transport(line.ends[0], {.fd = true});
  Frame frame;
  frame.id = 0x1ABCDEF1;
  frame.extended = true;
  frame.size = 2;
  frame.data = {0xCA, 0xFE};
  EXPECT_EQ(transport.send(frame), SendResult::sent);
  canfd_frame raw{};
  ASSERT_EQ(recv(line.ends[1], &raw, sizeof raw, 0), static_cast<ssize_t>(CAN_MTU));
  EXPECT_EQ(raw.can_id, 0x1ABCDEF1u | CAN_EFF_FLAG);
  EXPECT_EQ(raw.len, 2);
  EXPECT_EQ(raw.data[1], 0xFE);
  frame.fd = frame.bit_rate_switch = true;
  frame.size = 64;
  frame.data[63] = 5;
  EXPECT_EQ(transport.send(frame), SendResult::sent);
  ASSERT_EQ(recv(line.ends[1], &raw, sizeof raw, 0), static_cast<ssize_t>(CANFD_MTU));
  EXPECT_EQ(raw.len, 64);
  EXPECT_EQ(raw.flags, CANFD_BRS);
  EXPECT_EQ(raw.data[63], 5);
  frame.fd = false;  // 64 bytes do not fit a classic frame
  EXPECT_EQ(transport.send(frame), SendResult::failed);
  frame.size = 0;
  frame.error = true;
  EXPECT_EQ(transport.send(frame), SendResult::failed);
  EXPECT_EQ(transport.counts().sent.get(), 2u);
  EXPECT_EQ(transport.counts().failed.get(), 2u);
}

TEST(SocketCanTransport, AFullQueueIsWaitedForOnlyAsLongAsAllowed) {
  const Line line;
  const int smallest = 1;
  ASSERT_EQ(setsockopt(line.ends[0], SOL_SOCKET, SO_SNDBUF, &smallest, sizeof smallest), 0);
  SocketCanTransport transport(line.ends[0], {.send_patience_s = 2e-3});
  Frame frame;
  frame.size = 8;
  int sent = 0;
  while (transport.send(frame) == SendResult::sent && sent < 100'000)
    ++sent;
  ASSERT_LT(sent, 100'000);
  const std::uint64_t retries = transport.counts().retries.get();
  EXPECT_GE(retries, 1u);
  EXPECT_LE(retries, 41u);
  EXPECT_EQ(transport.counts().full.get(), 1u);
  const std::int64_t before = monotonic_ns();
  EXPECT_EQ(transport.send(frame), SendResult::full);
  EXPECT_GE(monotonic_ns() - before, 2'000'000);
  canfd_frame raw{};
  ASSERT_GT(recv(line.ends[1], &raw, sizeof raw, 0), 0);
  while (recv(line.ends[1], &raw, sizeof raw, MSG_DONTWAIT) > 0) {
  }
  EXPECT_EQ(transport.send(frame), SendResult::sent);
}

TEST(SocketCanTransport, GetsALargerBufferThanTheStandardOne) {
  const Line line;
  const SocketCanTransport transport(line.ends[0], {.receive_buffer_bytes = 1 << 20});
  EXPECT_GE(transport.receive_buffer_bytes(), 1 << 17);
}

TEST(SocketCanTransport, AllocatesNothing) {
  const Line line;
  SocketCanTransport transport(line.ends[0], {});
  Frame frame;
  line.write(classic(0x121, {1, 2, 3}), CAN_MTU);
  const test_support::AllocationCounter counter;
  EXPECT_TRUE(transport.receive(frame));
  frame.received = false;
  EXPECT_EQ(transport.send(frame), SendResult::sent);
  EXPECT_FALSE(transport.receive(frame));
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::rig

#endif
