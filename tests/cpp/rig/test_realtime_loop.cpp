// The whole loop in its own thread against a throttle in another one. Limits of time are wide: a busy machine may be
// late, and nothing here asserts that it is not.
#include "mgdd/rig/realtime_loop.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "support/throttle_on_bus.hpp"

namespace mgdd::rig {
namespace {

using namespace std::chrono_literals;
using test::bus_messages;
using test::ThrottleOnBus;

constexpr ScheduleSettings ordinary{.period_s = 1e-3, .realtime = false, .lock_memory = false};

SafetyEnvelope patient() {
  SafetyEnvelope e = test::bus_envelope();
  e.missed_deadlines = e.unsent_cycles = e.largest_age_cycles = 1e6;
  e.stall_s = 10.0;
  return e;
}

// Answers as fast as it is asked to, one sample of the plant per command.
class Node {
 public:
  explicit Node(ThrottleOnBus& throttle)
      : thread_([&throttle](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            if (throttle.take_commands()) {
              throttle.run_plant();
              throttle.answer(monotonic_ns());
            }
            std::this_thread::sleep_for(100us);
          }
        }) {}

 private:
  std::jthread thread_;
};

template <class Condition>
bool becomes(Condition condition) {
  for (int i = 0; i < 10'000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

// Asks again: every missed deadline lets the gate count its good frames anew.
bool reaches(RealtimeLoop& loop, SafetyRequest request, SafetyState state) {
  return becomes([&] {
    loop.cycle().request(request);
    return loop.cycle().state() == state;
  });
}

TEST(RealtimeLoop, DrivesAThrottleInAnotherThreadAndLeavesItOpen) {
  ThrottleOnBus throttle;
  RealtimeLoop loop(ordinary, {.initial_reference_deg = 30.0}, throttle.bus, control::Pid({}),
                    FrameCodec(bus_messages()), SafetyGate(patient()));
  {
    const Node node(throttle);
    loop.start();
    EXPECT_THROW(loop.start(), RigError);
    ASSERT_TRUE(becomes([&] { return loop.cycle().counts().fresh.get() > 20; }));
    ASSERT_TRUE(reaches(loop, SafetyRequest::arm, SafetyState::armed));
    ASSERT_TRUE(reaches(loop, SafetyRequest::run, SafetyState::run));
    LoopSample sample;
    double last = 0.0;
    ASSERT_TRUE(becomes([&] {
      while (loop.cycle().pop_sample(sample))
        last = sample.measured[0];
      return std::abs(last - 30.0) < 1.0;
    }));
    loop.cycle().set_reference(50.0);
    ASSERT_TRUE(becomes([&] {
      while (loop.cycle().pop_sample(sample))
        last = sample.measured[0];
      return std::abs(last - 50.0) < 1.0;
    }));
    EXPECT_FALSE(loop.wait(0.0));
    EXPECT_TRUE(loop.stop(5.0));
    EXPECT_FALSE(loop.thread().running());
  }
  throttle.take_commands();
  EXPECT_EQ(throttle.enable, 0.0);
  EXPECT_EQ(throttle.duty, 0.0);
  EXPECT_GT(loop.cycle().age().count(), 20u);
  EXPECT_GT(loop.cycle().sending().count(), 20u);
  EXPECT_EQ(loop.thread().timing().turns.get(), loop.thread().timing().compute.count());
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
