// The real-time thread, and the loop on it.
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "mgdd/rig/realtime_loop.hpp"
#include "mgdd/rig/realtime_thread.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"
#include "support/throttle_on_bus.hpp"

namespace mgdd::rig {
namespace {

using namespace std::chrono_literals;

ScheduleSettings ordinary(double period_s = 1e-3) {
  return {.period_s = period_s, .realtime = false, .lock_memory = false};
}

TEST(MonotonicClock, SleepsUntilATimeAndNotBeyondOneThatIsOver) {
  const std::int64_t until = monotonic_ns() + 3'000'000;
  sleep_until_ns(until);
  EXPECT_GE(monotonic_ns(), until);
  sleep_until_ns(until - 1'000'000'000);
  sleep_until_ns(0);
}

TEST(RealtimeThread, RefusesBadSettings) {
  const auto turn = [](const Turn&) { return false; };
  EXPECT_THROW(RealtimeThread({.period_s = 0.0}, turn), ParameterError);
  EXPECT_THROW(RealtimeThread({.period_s = 1e-6}, turn), ParameterError);
  EXPECT_THROW(RealtimeThread({.period_s = 2.0}, turn), ParameterError);
  EXPECT_THROW(RealtimeThread({.priority = 0}, turn), ParameterError);
  EXPECT_THROW(RealtimeThread({.priority = 100}, turn), ParameterError);
}

TEST(RealtimeThread, TurnsStandOnTheGridWhileThisThreadWorks) {
  std::vector<Turn> turns;
  turns.reserve(100);
  RealtimeThread thread(ordinary(), [&](const Turn& turn) {
    turns.push_back(turn);
    return turns.size() < 100;
  });
  EXPECT_TRUE(thread.wait(0.0));  // not started
  thread.start();
  std::uint64_t work = 0;
  while (thread.running())
    ++work;
  EXPECT_GT(work, 0u);
  ASSERT_TRUE(thread.wait(5.0));
  ASSERT_EQ(turns.size(), 100u);
  for (std::size_t k = 1; k < turns.size(); ++k) {
    const std::int64_t points = turns[k].number - turns[k - 1].number;
    EXPECT_GE(points, 1);
    EXPECT_EQ(turns[k].deadline_ns - turns[k - 1].deadline_ns, points * 1'000'000);
    EXPECT_GE(turns[k].woken_ns, turns[k].deadline_ns);
    EXPECT_GE(turns[k].missed_in_row, points - 1);
  }
  const TurnTiming& timing = thread.timing();
  EXPECT_EQ(timing.turns.get(), 100u);
  EXPECT_EQ(timing.compute.count(), 100u);
  EXPECT_GE(timing.lateness.count(), 100u);
}

TEST(RealtimeThread, AStallIsCountedSkippedAndReportedToTheNextTurn) {
  std::vector<Turn> turns;
  turns.reserve(8);
  RealtimeThread thread(ordinary(2e-3), [&](const Turn& turn) {
    turns.push_back(turn);
    if (turns.size() == 3) std::this_thread::sleep_for(50ms);
    return turns.size() < 6;
  });
  thread.start();
  ASSERT_TRUE(thread.wait(5.0));
  ASSERT_EQ(turns.size(), 6u);
  const std::int64_t skipped = turns[3].number - turns[2].number - 1;
  EXPECT_GE(skipped, 24);
  EXPECT_EQ(turns[3].missed_in_row, turns[2].missed_in_row + 1 + skipped);  // the turn itself was late as well
  const TurnTiming& timing = thread.timing();
  EXPECT_GE(timing.missed.get(), static_cast<std::uint64_t>(skipped) + 1);
  EXPECT_GE(timing.longest_row.get(), static_cast<std::uint64_t>(skipped) + 1);
  EXPECT_GE(timing.late.get(), 1u);
  EXPECT_GE(timing.compute.max_ns(), 50'000'000);
  EXPECT_GE(timing.lateness.max_ns(), 46'000'000);
}

TEST(RealtimeThread, TheTurnDecidesWhenItIsDoneAfterARequestToStop) {
  std::atomic<int> turns{0}, last{0};
  RealtimeThread thread(ordinary(), [&](const Turn& turn) {
    ++turns;
    if (turn.stopping) ++last;
    return last < 5;
  });
  thread.start();
  EXPECT_THROW(thread.start(), RigError);
  while (turns < 3)
    std::this_thread::yield();
  EXPECT_FALSE(thread.wait(0.001));
  thread.request_stop();
  EXPECT_TRUE(thread.wait(5.0));
  EXPECT_EQ(last, 5);
  EXPECT_FALSE(thread.running());
  EXPECT_TRUE(thread.started());
}

TEST(RealtimeThread, TheDestructorStops) {
  std::atomic<bool> over{false};
  std::atomic<int> turns{0};
  {
    RealtimeThread thread(ordinary(), [&](const Turn& turn) {
      ++turns;
      over = turn.stopping;
      return !turn.stopping;
    });
    thread.start();
    while (turns == 0)
      std::this_thread::yield();
  }
  EXPECT_TRUE(over);
}

TEST(RealtimeThread, ATurnThatHangsIsLeftAloneWithWhatItUses) {
  auto hang = std::make_shared<std::atomic<bool>>(true);
  const std::weak_ptr<std::atomic<bool>> used = hang;
  {
    RealtimeThread thread(
        ordinary(),
        [hang](const Turn&) {
          while (*hang)
            std::this_thread::sleep_for(1ms);
          return false;
        },
        0.05);
    thread.start();
    EXPECT_FALSE(thread.wait(0.01));
  }
  EXPECT_GE(used.use_count(), 2);
  *hang = false;
  hang.reset();
  for (int i = 0; i < 5'000 && !used.expired(); ++i)
    std::this_thread::sleep_for(1ms);
  EXPECT_TRUE(used.expired());
}

TEST(RealtimeThread, SaysWhatWasGranted) {
  RealtimeThread asked({.period_s = 1e-3}, [](const Turn& turn) { return turn.number < 3; });
  asked.start();
  ASSERT_TRUE(asked.wait(5.0));
  EXPECT_NE(asked.grant().realtime, !asked.grant().realtime_note.empty());
  EXPECT_NE(asked.grant().memory_locked, !asked.grant().memory_note.empty());
  RealtimeThread plain(ordinary(), [](const Turn& turn) { return turn.number < 3; });
  plain.start();
  ASSERT_TRUE(plain.wait(5.0));
  EXPECT_FALSE(plain.grant().realtime);
  EXPECT_FALSE(plain.grant().memory_locked);
}

TEST(RealtimeThread, TheLoopAllocatesNothing) {
  std::size_t allocations = 1;
  std::unique_ptr<test_support::AllocationCounter> counter;
  RealtimeThread thread(ordinary(), [&](const Turn& turn) {
    if (!counter) counter = std::make_unique<test_support::AllocationCounter>();
    allocations = counter->count();
    return turn.number < 20;
  });
  thread.start();
  ASSERT_TRUE(thread.wait(5.0));
  EXPECT_EQ(allocations, 0u);
}

using test::bus_messages;
using test::ThrottleOnBus;

SafetyEnvelope patient() {
  SafetyEnvelope e = test::bus_envelope();
  e.missed_deadlines = e.unsent_cycles = e.largest_age_cycles = 1e6;
  e.stall_s = 10.0;
  return e;
}

TEST(RealtimeLoop, TheDestructorSendsTheLastFrames) {
  ThrottleOnBus throttle;
  {
    RealtimeLoop loop(ordinary(), {}, throttle.bus, control::SlidingMode({}), FrameCodec(bus_messages()),
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
