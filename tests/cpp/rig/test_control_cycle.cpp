// One turn after the other, without a thread or a clock: the loop does nothing before it is told to, opens the bridge
// for every trouble of bus, deadlines and references, and its samples replay the gate.
#include <memory>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/control_cycle.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "support/cycle_rig.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"
#include "support/throttle_on_bus.hpp"

namespace mgdd::rig {
namespace {

using test::bus_envelope;
using test::bus_messages;
using test::period;
using test::start;
using Rig = test::CycleRig;

TEST(ControlCycle, TellsTheNodeToStayOpenUntilItRuns) {
  Rig rig;
  rig.cycle.set_reference(40.0);
  for (int i = 0; i < 30; ++i) {
    rig.turn();
    EXPECT_TRUE(rig.commanded && rig.node.command_ok);
    EXPECT_TRUE(rig.open());
    EXPECT_TRUE(std::isnan(rig.sample.asked_duty));
  }
  EXPECT_EQ(rig.cycle.state(), SafetyState::init);
  EXPECT_EQ(rig.sample.reference_deg, 40.0);
  EXPECT_NEAR(rig.node.last.angle_deg, rig.node.throttle.settings().start_deg, 0.2);
}

TEST(ControlCycle, RequestsAreFollowedInTheirOrderOnePerCycle) {
  Rig rig;
  rig.turns(12);
  for (const SafetyRequest r : {SafetyRequest::arm, SafetyRequest::run, SafetyRequest::stop, SafetyRequest::disarm})
    EXPECT_TRUE(rig.cycle.request(r));
  std::vector<SafetyState> states;
  for (int i = 0; i < 4; ++i) {
    rig.turn();
    states.push_back(rig.cycle.state());
  }
  EXPECT_EQ(states, (std::vector{SafetyState::armed, SafetyState::run, SafetyState::armed, SafetyState::init}));
  AuditEntry event;
  for (const SafetyState to : states) {
    ASSERT_TRUE(rig.cycle.pop_event(event));
    EXPECT_EQ(event.to, to);
    EXPECT_EQ(event.reason, SafetyReason::requested);
  }
  EXPECT_FALSE(rig.cycle.pop_event(event));
}

TEST(ControlCycle, ThreeMissedDeadlinesInARowOpenTheBridgeAndTwoDoNot) {
  Rig rig({.initial_reference_deg = 40.0});
  rig.drive();
  rig.turns(100);
  rig.turn(2);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
  EXPECT_EQ(rig.sample.missed, 2);
  rig.turns(5);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
  rig.turn(2, false, 1);  // the third one took too long
  EXPECT_EQ(rig.sample.missed, 3);
  EXPECT_EQ(rig.cycle.state(), SafetyState::limp);
  EXPECT_TRUE(rig.open());
}

TEST(ControlCycle, NothingIsSentWhileTheBusIsOff) {
  Rig rig({.initial_reference_deg = 40.0});
  rig.drive();
  rig.turns(20);
  Frame off;
  off.error = true;
  off.id = bus_error::bus_off;
  rig.node.bus->feed(off);
  rig.turn();
  EXPECT_EQ(rig.cycle.state(), SafetyState::limp);
  EXPECT_EQ(rig.cycle.reason(), SafetyReason::bus_fault);
  EXPECT_FALSE(rig.commanded);
  EXPECT_EQ(rig.cycle.bus_state(), BusState::off);
  off.id = bus_error::restarted;
  rig.node.bus->feed(off);
  rig.turn();
  EXPECT_TRUE(rig.commanded && rig.open());
}

TEST(ControlCycle, CommandsThatDoNotLeaveAreTroubleToo) {
  Rig rig({.initial_reference_deg = 40.0});
  rig.drive();
  for (int i = 0; i < 16; ++i)
    rig.node.bus->send({});
  for (int i = 0; i < 4; ++i) {  // nobody takes the commands
    rig.cycle.turn(
        {.number = ++rig.number, .deadline_ns = start + rig.number * period, .woken_ns = start + rig.number * period});
    rig.node.answer(start + rig.number * period);
  }
  EXPECT_EQ(rig.cycle.state(), SafetyState::limp);
  EXPECT_EQ(rig.cycle.reason(), SafetyReason::not_sent);
  EXPECT_GE(rig.cycle.transport_counts().full.get(), 3u);
}

TEST(ControlCycle, OnlyAFrameWithTheAngleIsFresh) {
  Rig rig({.initial_reference_deg = 40.0});
  rig.drive();
  rig.answers = false;
  rig.turn();
  const std::uint64_t fresh = rig.cycle.counts().fresh.get(), good = rig.cycle.counts().good_frames.get();
  rig.node.bus->feed(rig.node.sensors(start + rig.number * period));
  rig.turn();
  EXPECT_FALSE(rig.sample.fresh);
  EXPECT_EQ(rig.cycle.counts().fresh.get(), fresh);
  EXPECT_EQ(rig.cycle.counts().good_frames.get(), good + 1);
}

TEST(ControlCycle, AFrameThatCameAfterWakingIsOfAgeZero) {
  Rig rig;
  rig.turns(12);
  rig.answers = false;
  rig.turn();
  rig.node.answer(start + (rig.number + 1) * period + 40'000);
  rig.turn();
  EXPECT_TRUE(rig.sample.fresh);
  EXPECT_EQ(rig.sample.age_ns, 0);
}

TEST(ControlCycle, ASenderWithoutEndDoesNotHoldTheLoop) {
  const auto bus = std::make_shared<RingTransport>(8192, 16);
  ControlCycle cycle({}, bus, control::Pid({}), FrameCodec(bus_messages()), SafetyGate(bus_envelope()));
  for (int i = 0; i < 8192; ++i)
    bus->feed({.id = 0x7FF, .size = 1});
  std::size_t before = 8192;
  for (int i = 0; before > 0; ++i) {
    ASSERT_LT(i, 100);
    cycle.turn({.number = i, .deadline_ns = start + i * period, .woken_ns = start + i * period});
    ASSERT_LT(bus->waiting_for_loop(), before);
    EXPECT_TRUE(i > 0 || bus->waiting_for_loop() > 0);
    before = bus->waiting_for_loop();
  }
  EXPECT_EQ(cycle.counts().foreign_frames.get(), 8192u);
}

TEST(ControlCycle, AStopSendsOpenBridgesAndEnds) {
  Rig rig({.initial_reference_deg = 40.0, .stop_frames = 3});
  rig.drive();
  rig.turns(50);
  EXPECT_FALSE(rig.open());
  const int before = rig.node.commands;
  EXPECT_TRUE(rig.turn(0, true));
  EXPECT_TRUE(rig.open());
  EXPECT_TRUE(rig.turn(0, true));
  EXPECT_FALSE(rig.turn(0, true));
  EXPECT_EQ(rig.node.commands, before + 3);
  EXPECT_EQ(rig.cycle.state(), SafetyState::init);
}

TEST(ControlCycle, ADryRunComputesAndSendsNothing) {
  Rig rig({.initial_reference_deg = 40.0, .transmit = false});
  rig.drive();
  rig.turns(20);
  EXPECT_EQ(rig.node.commands, 0);
  EXPECT_GT(rig.sample.drive.duty, 0.0);
  EXPECT_EQ(rig.cycle.state(), SafetyState::run);
}

TEST(ControlCycle, RunsAgainAfterAResetWithoutTheOldIntegral) {
  Rig rig({.initial_reference_deg = 40.0});
  rig.keep = true;
  rig.drive();
  rig.turns(300);
  const double first = rig.kept[rig.kept.size() - 301].asked_duty;
  rig.cycle.request(SafetyRequest::abort);
  rig.turns(500);
  EXPECT_EQ(rig.cycle.state(), SafetyState::limp);
  rig.cycle.request(SafetyRequest::reset);
  rig.cycle.request(SafetyRequest::run);
  rig.turns(2);
  ASSERT_EQ(rig.cycle.state(), SafetyState::run);
  EXPECT_NEAR(rig.sample.asked_duty, first, 0.05);
  rig.turns(600);
  EXPECT_NEAR(rig.node.last.angle_deg, 40.0, 0.5);
}

TEST(ControlCycle, ATransportServesOneLoop) {
  test::ThrottleOnBus node;
  const auto make = [&] {
    return std::make_unique<ControlCycle>(CycleSettings{}, node.bus, control::Pid({}), FrameCodec(bus_messages()),
                                          SafetyGate(bus_envelope()));
  };
  auto first = make();
  EXPECT_THROW(make(), RigError);
  first.reset();
  EXPECT_NO_THROW(make());
}

TEST(ControlCycle, RefusesBadSettings) {
  EXPECT_THROW(Rig({.initial_reference_deg = NAN}), ParameterError);
  EXPECT_THROW(Rig({.stop_frames = 0}), ParameterError);
  EXPECT_THROW(Rig({.reference_timeout_s = 0.0}), ParameterError);
  EXPECT_THROW(Rig({.sample_capacity = 1000}), ParameterError);
  Rig rig;
  EXPECT_THROW(rig.cycle.set_reference(INFINITY), ParameterError);
}

TEST(ControlCycle, SamplesThatNobodyTakesAreCounted) {
  Rig rig({.sample_capacity = 4});
  for (int i = 0; i < 10; ++i)
    rig.cycle.turn({.number = i, .deadline_ns = start + i * period, .woken_ns = start + i * period});
  EXPECT_EQ(rig.cycle.samples().dropped(), 6u);
}

TEST(ControlCycle, AllocatesNothing) {
  const std::vector<loop::ThrottleController> all{
      control::GuidedPredictive({}), control::Pid({}), control::SlidingMode({}),
      loop::Mgdd1On<throttle::PwRModel>(throttle::PwRModel({}), control::Mgdd1Settings{})};
  for (const auto& controller : all) {
    Rig rig({.initial_reference_deg = 40.0}, controller);
    rig.drive();
    rig.turns(30);
    const test_support::AllocationCounter counter;
    rig.turns(50);
    rig.turn(5);
    rig.cycle.request(SafetyRequest::reset);
    rig.turns(30);
    EXPECT_EQ(counter.count(), 0u) << controller.index();
  }
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
