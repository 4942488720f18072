// Cycles of a healthy rig for the safety gate, and an envelope whose numbers nothing else has.
#pragma once

#include <gtest/gtest.h>

#include "mgdd/rig/safety_gate.hpp"

namespace mgdd::rig {

using Reason = SafetyReason;
using Request = SafetyRequest;

/// Round numbers in binary, so that times and steps are exact.
inline SafetyEnvelope narrow() {
  SafetyEnvelope e;
  e.cycle_s = 0.0009765625;
  e.duty_limit = 0.75;
  e.slew_per_s = 64.0;  // 1/16 per cycle
  e.ramp_s = 0.0;
  e.rms_duty_limit = 0.625;
  e.rms_duty_to_arm = 0.25;
  e.heat_time_constant_s = 2.0;
  e.stall_duty = 0.5;
  e.stall_move_deg = 0.75;
  e.stall_s = 0.125;  // 128 cycles
  e.largest_age_cycles = 4.0;
  e.held_cycles = 2.0;
  e.bad_frames = 5.0;
  e.good_frames = 7.0;
  e.missed_deadlines = 6.0;
  e.unsent_cycles = 3.0;
  e.sensor_cycles = 3.0;
  e.sensor_sum_v = 5.0;
  e.sensor_low_v = 0.25;
  e.sensor_high_v = 4.5;
  e.sensor_slope_v_per_s = 512.0;  // 1/2 V per cycle
  e.closed_deg = -2.0;
  e.open_deg = 80.0;
  e.travel_margin_deg = 4.0;
  return e;
}

inline SafetyFacts healthy(double angle_deg = 20.0) {
  return {.good_frames = 1, .age_s = 0.0, .sensor_v = {1.5, 3.5}, .angle_deg = angle_deg};
}

inline Drive cycle(SafetyGate& gate, const SafetyFacts& facts, double duty = 0.125) {
  gate.observe(facts);
  return gate.command(duty);
}
inline void pass(SafetyGate& gate, int cycles, double duty = 0.125) {
  for (int k = 0; k < cycles; ++k)
    (void)cycle(gate, healthy(), duty);
}

/// A gate in `run` at a duty of 1/8.
inline SafetyGate running(const SafetyEnvelope& envelope = narrow()) {
  SafetyGate gate(envelope);
  pass(gate, static_cast<int>(envelope.good_frames));
  EXPECT_EQ(gate.request(Request::arm), Reason::none);
  EXPECT_EQ(gate.request(Request::run), Reason::none);
  pass(gate, 40);
  EXPECT_EQ(gate.state(), SafetyState::run);
  while (gate.audit().pop())
    continue;
  return gate;
}

/// Cycles of these facts until the gate leaves `run`; -1 if it does not within 3000.
inline int leaves_after(SafetyGate& gate, const SafetyFacts& facts, double duty = 0.125) {
  for (int k = 1; k <= 3000; ++k) {
    const Drive drive = cycle(gate, facts, duty);
    if (gate.state() == SafetyState::run) continue;
    EXPECT_EQ(drive.duty, 0.0);
    EXPECT_TRUE(drive.bridge_open);
    return k;
  }
  return -1;
}

inline void expect_off(const SafetyGate& gate, SafetyState state, Reason reason) {
  EXPECT_EQ(gate.state(), state);
  EXPECT_EQ(gate.reason(), reason);
  EXPECT_EQ(gate.drive().duty, 0.0);
  EXPECT_TRUE(gate.drive().bridge_open);
}

}  // namespace mgdd::rig
