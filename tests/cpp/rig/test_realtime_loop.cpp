// The whole loop in its own thread against a throttle in another one. Limits of time are wide: a busy machine may be
// late, and nothing here asserts that it is not.
#include "mgdd/rig/realtime_loop.hpp"

#include <gtest/gtest.h>

#include <string>

#include "mgdd/common/error.hpp"
#include "support/throttle_on_bus.hpp"

namespace mgdd::rig {
namespace {

using test::bus_messages;
using test::ThrottleOnBus;

constexpr ScheduleSettings ordinary{.period_s = 1e-3, .realtime = false, .lock_memory = false};

SafetyEnvelope patient() {
  SafetyEnvelope e = test::bus_envelope();
  e.missed_deadlines = e.unsent_cycles = e.largest_age_cycles = 1e6;
  e.stall_s = 10.0;
  return e;
}

TEST(RealtimeLoop, TheDestructorSendsTheLastFrames) {
  ThrottleOnBus throttle;
  {
    RealtimeLoop loop(ordinary, {}, throttle.bus, control::SlidingMode({}), FrameCodec(bus_messages()),
                      SafetyGate(patient()));
    loop.start();
  }
  ASSERT_TRUE(throttle.take_commands());
  EXPECT_GE(throttle.commands, 5);  // more, where the thread had a turn before it was asked to stop
  EXPECT_EQ(throttle.enable, 0.0);
  EXPECT_FALSE(throttle.bus->claim().taken());
}

TEST(RealtimeLoop, AStopMayTakeItsFrames) {
  ThrottleOnBus throttle;
  control::PidSettings pid;
  SafetyEnvelope envelope;
  pid.sample_s = envelope.cycle_s = 0.5;
  const RealtimeLoop loop({.period_s = 0.5}, {.stop_frames = 40}, throttle.bus, control::Pid(pid),
                          FrameCodec(bus_messages()), SafetyGate(envelope));
  EXPECT_GE(loop.patience_s(), 22.0);
}

TEST(RealtimeLoop, PeriodControllerAndGateMustAgree) {
  ThrottleOnBus throttle;
  const auto refused = [&](double period_s, double sample_s, double cycle_s, const std::string& words) {
    control::PidSettings pid;
    pid.sample_s = sample_s;
    SafetyEnvelope envelope;
    envelope.cycle_s = cycle_s;
    try {
      const RealtimeLoop loop({.period_s = period_s}, {}, throttle.bus, control::Pid(pid), FrameCodec(bus_messages()),
                              SafetyGate(envelope));
      ADD_FAILURE() << words;
    } catch (const ParameterError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
    EXPECT_FALSE(throttle.bus->claim().taken());
  };
  refused(2e-3, 1e-3, 2e-3, "sample_s = 0.001 s: must be 0.002 s, the period of the loop");
  refused(2e-3, 2e-3, 1e-3, "cycle_s = 0.001 s: must be 0.002 s");
  refused(1e-6, 1e-3, 1e-3, "period_s");
}

}  // namespace
}  // namespace mgdd::rig
