// One turn after the other, without a thread or a clock: the loop does nothing before it is told to, and opens the
// bridge for every trouble of bus and deadlines.
#include "mgdd/rig/control_cycle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "mgdd/common/error.hpp"
#include "support/cycle_rig.hpp"
#include "support/no_alloc.hpp"
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

}  // namespace
}  // namespace mgdd::rig
