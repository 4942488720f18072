// The other side of a ring: a virtual throttle behind the messages of a made-up bus, asymmetric on purpose (both byte
// orders, protection on the command and the status only), stepped by the test.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>

#include "mgdd/loop/virtual_throttle.hpp"
#include "mgdd/rig/control_cycle.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::test {

inline rig::SignalLayout intel(int start, int length, double scale, bool is_signed = false, double offset = 0.0) {
  return {.start = start,
          .length = length,
          .type = is_signed ? rig::RawType::signed_integer : rig::RawType::unsigned_integer,
          .scale = scale,
          .offset = offset};
}

inline rig::FrameCodecSettings bus_messages() {
  using rig::Commanded, rig::Measured;
  rig::SignalLayout angle = intel(23, 16, 0.01, false, -5.0);  // most significant bit first
  angle.byte_order = rig::ByteOrder::big_endian;
  rig::FrameCodecSettings s;
  s.command = {.id = 0x120,
               .protection = rig::E2eSettings{.data_id = 0x120},
               .signals = {{Commanded::duty, intel(16, 16, 0.00005, true)},
                           {Commanded::fixed, intel(32, 3, 1.0), 2.0},
                           {Commanded::enable, intel(35, 1, 1.0)},
                           {Commanded::reference_deg, intel(40, 16, 0.01)}}};
  s.received = {
      {.id = 0x121, .protection = rig::E2eSettings{.data_id = 0x121}, .signals = {{Measured::angle_deg, angle}}},
      {.id = 0x18FF0122,
       .extended = true,
       .size = 6,
       .signals = {{Measured::first_v, intel(0, 12, 0.00125)},
                   {Measured::second_v, intel(12, 12, 0.00125)},
                   {Measured::supply_v, intel(24, 10, 0.02)}}}};
  return s;
}

inline rig::SafetyEnvelope bus_envelope() {
  rig::SafetyEnvelope e;
  e.good_frames = 5;
  e.ramp_s = 0.0;
  return e;
}

/// Time in ns passes only when the test says so.
struct ThrottleOnBus {
  ThrottleOnBus() : throttle(settings()) {}

  static loop::VirtualThrottleSettings settings() {
    loop::VirtualThrottleSettings s;
    s.sensors.closed_v = 0.5;
    s.sensors.span_v = 4.0;
    s.sensors.noise_v = 0.0;
    s.start_deg = s.throttle.limp_home_deg;
    return s;
  }

  /// What the commands that wait say; false: there was none.
  bool take_commands() {
    rig::Frame frame;
    bool any = false;
    while (bus->take(frame)) {
      any = true;
      ++commands;
      const auto payload = frame.payload();
      command_ok = check.push(payload) != rig::E2eStatus::wrong_crc && frame.id == 0x120;
      const auto& signals = messages.command.signals;
      duty = rig::unpack(signals[0].layout, payload).value_or(NAN);
      fixed = rig::unpack(signals[1].layout, payload).value_or(NAN);
      enable = rig::unpack(signals[2].layout, payload).value_or(NAN);
      reference_deg = rig::unpack(signals[3].layout, payload).value_or(NAN);
    }
    return any;
  }

  void run_plant() { last = throttle.step({.duty = duty, .bridge_open = enable != 1.0}); }

  rig::Frame status(std::int64_t stamp_ns) {
    rig::Frame frame = {.id = 0x121, .size = 8, .monotonic_ns = stamp_ns};
    const auto& message = messages.received[0];
    (void)rig::pack(message.signals[0].layout, last.sensed.angle_deg, rig::OutOfRange::clamp, {frame.data.data(), 8});
    (void)rig::protect(*message.protection, counter, {frame.data.data(), 8});
    counter = rig::next_counter(*message.protection, counter);
    return frame;
  }
  rig::Frame sensors(std::int64_t stamp_ns) const {
    rig::Frame frame = {.id = 0x18FF0122, .extended = true, .size = 6, .monotonic_ns = stamp_ns};
    const auto& signals = messages.received[1].signals;
    (void)rig::pack(signals[0].layout, last.sensed.volts[0], rig::OutOfRange::clamp, {frame.data.data(), 6});
    (void)rig::pack(signals[1].layout, last.sensed.volts[1], rig::OutOfRange::clamp, {frame.data.data(), 6});
    (void)rig::pack(signals[2].layout, last.supply_v, rig::OutOfRange::clamp, {frame.data.data(), 6});
    return frame;
  }
  void answer(std::int64_t stamp_ns) {
    bus->feed(sensors(stamp_ns));
    bus->feed(status(stamp_ns));
  }

  std::shared_ptr<rig::RingTransport> bus = std::make_shared<rig::RingTransport>(64, 16);
  rig::FrameCodecSettings messages = bus_messages();
  rig::E2eCheck check{*messages.command.protection};
  loop::VirtualThrottle throttle;
  loop::VirtualThrottleSample last = throttle.step({.bridge_open = true});
  int counter = 3;
  int commands = 0;
  bool command_ok = false;
  double duty = 0.0, enable = 0.0, fixed = 0.0, reference_deg = 0.0;
};

}  // namespace mgdd::test
