// One turn of a control cycle after the other, without a thread or a clock, with a throttle behind its bus.
#pragma once

#include "mgdd/rig/control_cycle.hpp"
#include "support/test.hpp"
#include "support/throttle_on_bus.hpp"

namespace mgdd::test {

inline constexpr std::int64_t period = 1'000'000, start = 50'000'000'000;

struct CycleRig {
  explicit CycleRig(const rig::CycleSettings& settings = {},
                    const loop::ThrottleController& controller = control::Pid({}),
                    const rig::SafetyEnvelope& envelope = bus_envelope())
      : cycle(settings, node.bus, controller, rig::FrameCodec(bus_messages()), rig::SafetyGate(envelope)) {}

  /// One turn; grid points before it were skipped, and the turn before took too long by so many. The node answers
  /// 0.2 ms later unless it is silent.
  bool turn(std::int64_t skipped = 0, bool stopping = false, std::int64_t late = 0) {
    number += 1 + skipped;
    const std::int64_t deadline = start + number * period;
    const bool more = cycle.turn({.number = number,
                                  .deadline_ns = deadline,
                                  .woken_ns = deadline + 30'000,
                                  .missed = skipped + late,
                                  .skipped = skipped,
                                  .missed_in_row = skipped + late,
                                  .stopping = stopping});
    commanded = node.take_commands();
    node.run_plant();
    if (answers) node.answer(deadline + 200'000);
    while (cycle.pop_sample(sample)) {
      if (keep) kept.push_back(sample);
    }
    return more;
  }
  void turns(int n) {
    for (int i = 0; i < n; ++i)
      turn();
  }
  void drive() {
    turns(12);
    cycle.request(rig::SafetyRequest::arm);
    cycle.request(rig::SafetyRequest::run);
    turns(2);
    ASSERT_EQ(cycle.state(), rig::SafetyState::run);
  }
  bool open() const { return node.enable == 0.0 && node.duty == 0.0; }

  ThrottleOnBus node;
  rig::ControlCycle cycle;
  rig::LoopSample sample;
  std::vector<rig::LoopSample> kept;
  std::int64_t number = -1;
  bool answers = true, keep = false, commanded = false;
};

}  // namespace mgdd::test
