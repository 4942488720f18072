// Between frames and numbers: every number to its place and back, protection on both ways, and what a codec refuses.
#include "mgdd/rig/frame_codec.hpp"

#include "mgdd/common/error.hpp"
#include "support/test.hpp"
#include "support/throttle_on_bus.hpp"

namespace mgdd::rig {
namespace {

using test::bus_messages;
using test::intel;
using test::ThrottleOnBus;

constexpr std::int64_t now = 7'000'000;

TEST(FrameCodec, ReadsEveryNumberFromItsPlace) {
  ThrottleOnBus node;
  FrameCodec codec(bus_messages());
  Measurements m;
  EXPECT_FALSE(m.oldest_ns());
  EXPECT_EQ(codec.read(node.sensors(now), m), FrameVerdict::good);
  EXPECT_FALSE(codec.brought_angle());
  EXPECT_FALSE(m.oldest_ns());
  EXPECT_EQ(codec.read(node.status(now), m), FrameVerdict::waiting);  // the counter has to run in
  EXPECT_EQ(codec.read(node.status(now), m), FrameVerdict::waiting);
  EXPECT_TRUE(std::isnan(m.of(Measured::angle_deg)));
  EXPECT_EQ(codec.read(node.status(now + 5), m), FrameVerdict::good);
  EXPECT_TRUE(codec.brought_angle());
  EXPECT_EQ(m.oldest_ns(), now);
  EXPECT_NEAR(m.of(Measured::angle_deg), node.last.sensed.angle_deg, 0.0051);
  EXPECT_NEAR(m.of(Measured::first_v), node.last.sensed.volts[0], 0.00063);
  EXPECT_NEAR(m.of(Measured::second_v), node.last.sensed.volts[1], 0.00063);
  EXPECT_NEAR(m.of(Measured::supply_v), 12.0, 0.0101);
  EXPECT_TRUE(std::isnan(m.of(Measured::current_a)));
  EXPECT_EQ(codec.read(node.sensors(now + 90), m), FrameVerdict::good);
  EXPECT_EQ(m.oldest_ns(), now + 5);  // that of the angle now
}

TEST(FrameCodec, BadFramesChangeNothing) {
  ThrottleOnBus node;
  FrameCodec codec(bus_messages());
  Measurements m;
  (void)codec.read(node.sensors(now), m);
  for (int i = 0; i < 3; ++i)
    (void)codec.read(node.status(now), m);
  const Measurements before = m;
  Frame flipped = node.status(now + 1);
  flipped.data[2] ^= 0x10;
  EXPECT_EQ(codec.read(flipped, m), FrameVerdict::bad);
  Frame shorter = node.sensors(now + 1);
  shorter.size = 5;
  EXPECT_EQ(codec.read(shorter, m), FrameVerdict::bad);
  Frame longer = node.sensors(now + 1);
  longer.size = 8;
  EXPECT_EQ(codec.read(longer, m), FrameVerdict::bad);
  const Frame again = node.status(now + 1);
  EXPECT_EQ(codec.read(again, m), FrameVerdict::good);
  m = before;
  EXPECT_EQ(codec.read(again, m), FrameVerdict::bad);  // repeated
  EXPECT_EQ(m.stamp_ns, before.stamp_ns);

  for (const auto& change : std::initializer_list<std::function<void(Frame&)>>{
           [](Frame& f) { f.id = 0x122; }, [](Frame& f) { f.extended = true; }, [](Frame& f) { f.error = true; },
           [](Frame& f) { f.remote = true; }}) {
    Frame foreign = node.status(now + 2);
    change(foreign);
    EXPECT_EQ(codec.read(foreign, m), FrameVerdict::foreign);
  }
  EXPECT_EQ(m.stamp_ns, before.stamp_ns);
}

TEST(FrameCodec, ANumberThatIsNoneMakesItsFrameBad) {
  FrameCodecSettings s = bus_messages();
  s.received[1].size = 8;
  s.received[1].signals = {{Measured::first_v, {.start = 0, .length = 32, .type = RawType::float32}},
                           {Measured::second_v, {.start = 32, .length = 32, .type = RawType::float32}}};
  FrameCodec codec(s);
  Measurements m;
  Frame frame{.id = 0x18FF0122, .extended = true, .size = 8, .monotonic_ns = now};
  EXPECT_EQ(codec.read(frame, m), FrameVerdict::good);
  frame.data[7] = 0x7F;
  frame.data[6] = 0xC0;  // NaN
  frame.data[3] = 0x40;  // 2
  frame.monotonic_ns = now + 9;
  EXPECT_EQ(codec.read(frame, m), FrameVerdict::bad);
  EXPECT_EQ(m.of(Measured::first_v), 0.0);
  EXPECT_EQ(m.of(Measured::second_v), 0.0);
  EXPECT_EQ(m.stamp_ns[static_cast<std::size_t>(Measured::first_v)], now);
}

TEST(FrameCodec, WritesProtectedCommands) {
  ThrottleOnBus node;
  FrameCodec codec(bus_messages());
  Frame frame;
  for (int i = 0; i < 40; ++i) {
    const double duty = -0.5 + 0.025 * i;
    ASSERT_TRUE(codec.write({.duty = duty, .bridge_open = i % 3 == 0}, 2.0 * i, frame));
    node.bus->send(frame);
    ASSERT_TRUE(node.take_commands());
    EXPECT_TRUE(node.command_ok);
    EXPECT_NEAR(node.duty, duty, 2.6e-5);
    EXPECT_EQ(node.enable, i % 3 == 0 ? 0.0 : 1.0);
    EXPECT_EQ(node.fixed, 2.0);
    EXPECT_NEAR(node.reference_deg, 2.0 * i, 1e-9);
  }
  EXPECT_EQ(node.check.counts().of(E2eStatus::ok), 39u);
  const Frame before = frame;
  EXPECT_FALSE(codec.write({.duty = std::numeric_limits<double>::quiet_NaN()}, 0.0, frame));
  ASSERT_TRUE(codec.write({}, 0.0, frame));
  EXPECT_EQ(frame.data[1], (before.data[1] + 1) % 16);  // what could not be sent took no number
}

TEST(FrameCodec, RefusesWhatCannotWork) {
  const auto refused = [](const std::function<void(FrameCodecSettings&)>& change, const std::string& words) {
    FrameCodecSettings s = bus_messages();
    change(s);
    try {
      const FrameCodec codec(s);
      ADD_FAILURE() << "accepted: " << words;
    } catch (const ParameterError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  refused([](auto& s) { s.received[0].signals.clear(); }, "angle_deg is read from no signal");
  refused([](auto& s) { s.received[1].signals[1].what = Measured::first_v; }, "first_v: the name stands twice");
  refused([](auto& s) { s.received[1].signals[1].what = Measured::angle_deg; }, "angle_deg is read from 2 signals");
  refused([](auto& s) { s.command.signals.erase(s.command.signals.begin()); }, "duty is written to 0 signals");
  refused([](auto& s) { s.received[0].id = 0x120; }, "must belong to one message");
  refused([](auto& s) { s.received[1].id = 0x2000'0000; }, "29 if extended");
  refused([](auto& s) { s.received[0].id = 0x800; }, "11 bits");
  refused([](auto& s) { s.received[0].size = 7; }, "message 0x121");
  refused([](auto& s) { s.command.signals[1].layout.start = 31; }, "duty");
  refused([](auto& s) { s.command.signals[0].layout.start = 8; }, "counter");
  refused([](auto& s) { s.received[1].signals[2].layout.start = 40; }, "supply_v");
}

TEST(FrameCodec, AFixedNumberMayBeAnotherOneWithAnOpenBridge) {
  FrameCodecSettings s = bus_messages();
  s.command.signals.push_back({Commanded::fixed, intel(56, 4, 1.0), 5.0, 11.0});
  FrameCodec codec(s);
  Frame frame;
  for (const bool open : {true, false, true}) {
    ASSERT_TRUE(codec.write({.duty = open ? 0.0 : 0.25, .bridge_open = open}, 30.0, frame));
    EXPECT_EQ(unpack(s.command.signals.back().layout, frame.payload()), open ? 11.0 : 5.0);
    EXPECT_EQ(unpack(s.command.signals[1].layout, frame.payload()), 2.0);  // without one of its own it stays
  }
}

TEST(FrameCodec, AMissingNumberIsNaNAndOneThatALoopNeedsMakesItsFrameBad) {
  FrameCodecSettings s = bus_messages();
  s.received[1].signals[2].missing_raws = {1023, 1022};
  s.received[1].signals[1].missing_raws = {4095};
  FrameCodec codec(s);
  ThrottleOnBus node;
  Measurements m;
  const auto& sensors = s.received[1].signals;
  Frame frame = node.sensors(now);
  const auto write = [&](std::size_t which, std::uint64_t raw) {
    ASSERT_EQ(pack_raw(sensors[which].layout, raw, OutOfRange::refuse, {frame.data.data(), frame.size}),
              PackStatus::ok);
  };
  for (const std::uint64_t raw : {1023u, 1021u, 1022u}) {
    write(2, raw);
    EXPECT_EQ(codec.read(frame, m), FrameVerdict::good);
    if (raw == 1021) {
      EXPECT_NEAR(m.of(Measured::supply_v), 20.42, 1e-9);
    } else {
      EXPECT_TRUE(std::isnan(m.of(Measured::supply_v)));
    }
  }
  const double before_v = m.of(Measured::second_v);
  write(1, 4095);
  EXPECT_EQ(codec.read(frame, m), FrameVerdict::bad);
  EXPECT_EQ(m.of(Measured::second_v), before_v);
}

TEST(FrameCodec, AMissingSignedNumberIsTold) {
  FrameCodecSettings s = bus_messages();
  s.received[1].signals.push_back(
      {Measured::current_a, intel(34, 12, 0.01, true), {static_cast<std::uint64_t>(std::int64_t{-2048})}});
  FrameCodec codec(s);
  ThrottleOnBus node;
  Measurements m;
  Frame frame = node.sensors(now);
  const auto& current = s.received[1].signals.back();
  for (const std::int64_t raw : {-2047, -2048}) {
    ASSERT_EQ(
        pack_raw(current.layout, static_cast<std::uint64_t>(raw), OutOfRange::refuse, {frame.data.data(), frame.size}),
        PackStatus::ok);
    EXPECT_EQ(codec.read(frame, m), FrameVerdict::good);
    EXPECT_EQ(std::isnan(m.of(Measured::current_a)), raw == -2048);
  }
}

TEST(FrameCodec, ACommandMayBeLongAndExtended) {
  FrameCodecSettings s = bus_messages();
  s.command = {.id = 0x120, .extended = true, .size = 12, .signals = {{Commanded::duty, intel(80, 16, 0.00005, true)}}};
  FrameCodec codec(s);
  Frame frame;
  ASSERT_TRUE(codec.write({.duty = -0.25}, 0.0, frame));
  EXPECT_EQ(frame.id, 0x120u);
  EXPECT_TRUE(frame.extended);
  EXPECT_TRUE(frame.fd);
  EXPECT_EQ(frame.size, 12);
  EXPECT_EQ(frame.data[10] | frame.data[11] << 8, 0x10000 - 5000);
  s.command.size = 8;
  s.command.signals[0].layout.start = 48;
  ASSERT_TRUE(FrameCodec(s).write({}, 0.0, frame));
  EXPECT_FALSE(frame.fd);
}

TEST(FrameCodec, OneNumberMayNameAShortAndALongIdentifier) {
  FrameCodecSettings s = bus_messages();
  s.received[1].id = 0x121;
  FrameCodec codec(s);
  ThrottleOnBus node;
  Measurements m;
  Frame sensors = node.sensors(now);
  sensors.id = 0x121;
  EXPECT_EQ(codec.read(sensors, m), FrameVerdict::good);
  EXPECT_EQ(codec.read(node.status(now), m), FrameVerdict::waiting);
}

}  // namespace
}  // namespace mgdd::rig
