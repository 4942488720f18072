// A throttle controller on a real bus: rig/control_cycle.hpp on the thread of rig/realtime_thread.hpp, at one period
// that loop, controller and safety gate share. Made, started once, stopped; it reads no clock but that of its
// deadlines. What runs while it is driven is real-time safe; all calls here are offline code, from any thread but one
// at a time.
#pragma once

#include <memory>

#include "mgdd/rig/control_cycle.hpp"
#include "mgdd/rig/realtime_thread.hpp"

namespace mgdd::rig {

class RealtimeLoop {
 public:
  /// ParameterError for bad settings, or where period, sample time of the controller and cycle of the gate differ;
  /// RigError where the transport serves another loop.
  RealtimeLoop(const ScheduleSettings& schedule, const CycleSettings& settings, const AnyTransport& transport,
               const loop::ThrottleController& controller, const FrameCodec& codec, const SafetyGate& gate);

  /// Returns at once. RigError where it was started before.
  void start() { thread_.start(); }
  /// How long a stop takes: its frames, one per period, and 2 s for a busy machine.
  [[nodiscard]] double patience_s() const noexcept { return patience_s_; }
  /// Asks for the safe frames and the end; true where the loop ended within so long.
  bool stop(double timeout_s) {
    thread_.request_stop();
    return thread_.wait(timeout_s);
  }
  /// Whether the loop has ended, after at most so long.
  [[nodiscard]] bool wait(double timeout_s) const { return thread_.wait(timeout_s); }

  ControlCycle& cycle() noexcept { return *cycle_; }
  [[nodiscard]] const ControlCycle& cycle() const noexcept { return *cycle_; }
  [[nodiscard]] const RealtimeThread& thread() const noexcept { return thread_; }

 private:
  std::shared_ptr<ControlCycle> cycle_;  // the thread holds it too
  double patience_s_;
  RealtimeThread thread_;
};

}  // namespace mgdd::rig
