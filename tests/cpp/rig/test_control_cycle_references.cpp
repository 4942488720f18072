// References of a control cycle: by slot and queue, renewed and not; its samples give controller and gate again.
#include "mgdd/rig/control_cycle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "support/cycle_rig.hpp"

namespace mgdd::rig {
namespace {

using test::bus_envelope;
using test::period;
using test::start;
using Rig = test::CycleRig;

TEST(ControlCycle, FollowsTheReferenceOverTheBus) {
  Rig rig({.initial_reference_deg = 25.0});
  rig.drive();
  rig.turns(600);
  EXPECT_NEAR(rig.node.last.angle_deg, 25.0, 0.5);
  rig.cycle.set_reference(60.0);
  rig.turn();
  EXPECT_EQ(rig.sample.reference_deg, 60.0);
  rig.turns(600);
  EXPECT_NEAR(rig.node.last.angle_deg, 60.0, 0.5);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
  EXPECT_EQ(rig.cycle.counts().bad_frames.get(), 0u);
  EXPECT_NEAR(rig.node.reference_deg, 60.0, 1e-9);
  EXPECT_EQ(rig.sample.age_ns, 830'000);
}

TEST(ControlCycle, AReferenceThatIsNotRenewedAborts) {
  Rig rig({.initial_reference_deg = 40.0, .reference_timeout_s = 0.05});
  rig.turns(200);  // time before the start does not count
  rig.drive();
  rig.turns(45);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
  rig.turns(10);
  EXPECT_EQ(rig.cycle.state(), SafetyState::limp);
  EXPECT_EQ(rig.cycle.reason(), SafetyReason::aborted);
  EXPECT_EQ(rig.cycle.counts().reference_timeouts.get(), 1u);
}

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

TEST(ControlCycle, QueuedReferencesAreTakenOnePerGridPoint) {
  SafetyEnvelope envelope = bus_envelope();
  envelope.missed_deadlines = 100.0;
  Rig rig({.initial_reference_deg = 12.0, .queue_capacity = 8}, control::Pid({}), envelope);
  EXPECT_THROW(rig.cycle.queue_references(std::vector<double>(9, 1.0)), RigError);
  EXPECT_THROW(rig.cycle.queue_references(std::vector<double>{1.0, NAN}), ParameterError);
  EXPECT_EQ(rig.cycle.queued_references(), 0u);
  rig.cycle.queue_references(std::vector{13.0, 14.0, 15.0, 16.0, 17.0, 18.0});
  rig.turns(20);
  EXPECT_EQ(rig.cycle.queued_references(), 6u);  // not before it runs
  rig.drive();
  std::vector<double> seen{rig.sample.reference_deg};
  for (const std::int64_t skipped : {0, 0, 2, 0, 0, 0}) {
    rig.turn(skipped, false, 1);  // one that only took too long has had its reference
    seen.push_back(rig.sample.reference_deg);
  }
  EXPECT_EQ(seen, (std::vector{12.0, 13.0, 14.0, 17.0, 18.0, 18.0, 18.0}));
  rig.cycle.set_reference(9.0);
  rig.turn();
  EXPECT_EQ(rig.sample.reference_deg, 9.0);
}

// A record of samples gives every duty again: the loop adds nothing of its own.
TEST(ControlCycle, SamplesReplayTheControllerBitForBit) {
  loop::ThrottleController controller = control::GuidedPredictive({});
  Rig rig({.initial_reference_deg = 30.0}, controller);
  rig.keep = true;
  rig.drive();
  for (int i = 0; i < 400; ++i) {
    if (i == 150) rig.cycle.set_reference(17.0);
    rig.answers = i % 11 != 0;  // cycles without a new angle
    rig.turn();
  }
  ASSERT_EQ(rig.cycle.state(), SafetyState::run);
  int stepped = 0, stale = 0;
  for (const LoopSample& s : rig.kept) {
    if (s.state != SafetyState::run) continue;
    ++stepped;
    stale += s.fresh ? 0 : 1;
    const double angle = s.fresh ? s.measured[0] : std::numeric_limits<double>::quiet_NaN();
    const double duty = std::visit([&](auto& c) { return c.step(s.reference_deg, angle); }, controller);
    ASSERT_EQ(duty, s.asked_duty) << s.cycle;
  }
  EXPECT_GT(stepped, 400);
  EXPECT_GT(stale, 30);
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
