// References of a control cycle: by slot and queue, renewed and not; its samples give controller and gate again.
#include "mgdd/rig/control_cycle.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "mgdd/rig/monotonic_clock.hpp"
#include "support/cycle_rig.hpp"

namespace mgdd::rig {
namespace {

using test::period;
using test::start;
using Rig = test::CycleRig;

// Turns of a second before now, so that what is set now lies ahead of all of them.
TEST(ControlCycle, AReferenceThatIsRenewedKeepsItDriven) {
  Rig rig({.initial_reference_deg = 40.0, .reference_timeout_s = 0.05});
  rig.number = (monotonic_ns() - start) / period - 1000;
  rig.drive();
  rig.turns(45);
  rig.cycle.set_reference(41.0);
  rig.turns(200);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
  EXPECT_EQ(rig.cycle.counts().reference_timeouts.get(), 0u);
}

TEST(ControlCycle, QueuedReferencesCountAsRenewed) {
  Rig rig({.initial_reference_deg = 40.0, .reference_timeout_s = 0.05});
  rig.cycle.queue_references(std::vector<double>(100, 41.0));
  rig.drive();
  rig.turns(145);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
  rig.turns(10);
  EXPECT_EQ(rig.cycle.reason(), SafetyReason::aborted);
}

// And with what the gate was told, every drive, also those of a gate that changes its state.
TEST(ControlCycle, SamplesReplayTheGateBitForBit) {
  const SafetyEnvelope envelope = test::bus_envelope();
  Rig rig({.initial_reference_deg = 30.0});
  rig.keep = true;
  rig.drive();
  for (int i = 0; i < 300; ++i) {
    if (i == 60) rig.cycle.set_reference(70.0);
    rig.answers = i % 7 != 0 && i < 250;  // and then silence
    rig.turn(i == 120 ? 2 : 0);
  }
  ASSERT_EQ(rig.cycle.state(), SafetyState::limp);
  SafetyGate gate(envelope);
  bool sent = true;
  for (const LoopSample& s : rig.kept) {
    SafetyFacts facts{.good_frames = s.good_frames,
                      .bad_frames = s.bad_frames,
                      .sensor_v = {s.measured[1], s.measured[2]},
                      .angle_deg = s.measured[0],
                      .bus = s.bus,
                      .sent = sent,
                      .missed_deadlines = s.missed,
                      .request = s.request};
    if (s.age_ns >= 0) facts.age_s = static_cast<double>(s.age_ns) * 1e-9;
    gate.observe(facts);
    const bool driven = gate.state() == SafetyState::run;
    ASSERT_EQ(gate.command(driven ? s.asked_duty : 0.0), s.drive) << s.cycle;
    ASSERT_EQ(gate.state(), s.state) << s.cycle;
    sent = s.result == SendResult::sent;
  }
}

}  // namespace
}  // namespace mgdd::rig
