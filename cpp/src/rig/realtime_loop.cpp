#include "mgdd/rig/realtime_loop.hpp"

#include <cmath>
#include <variant>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/loop/throttle_loop.hpp"

namespace mgdd::rig {
namespace {

// The thread rounds its period to nanoseconds.
void require_same(std::string_view name, double value_s, double period_s) {
  if (!(std::abs(value_s - period_s) < 1e-9)) {
    throw ParameterError(name, value_s, "must be " + text(period_s) + " s, the period of the loop", "s");
  }
}

}  // namespace

RealtimeLoop::RealtimeLoop(const ScheduleSettings& schedule, const CycleSettings& settings,
                           const AnyTransport& transport, const loop::ThrottleController& controller,
                           const FrameCodec& codec, const SafetyGate& gate)
    : cycle_([&] {
        validate(schedule);
        const auto made_for = std::visit([](const auto& c) { return loop::sample_s_of(c); }, controller);
        require_same("sample_s", made_for.value_or(schedule.period_s), schedule.period_s);
        require_same("cycle_s", gate.envelope().cycle_s, schedule.period_s);
        return std::make_shared<ControlCycle>(settings, transport, controller, codec, gate);
      }()),
      patience_s_(2.0 + (settings.stop_frames + 2) * schedule.period_s),
      thread_(schedule, [cycle = cycle_](const Turn& turn) { return cycle->turn(turn); }, patience_s_) {}

}  // namespace mgdd::rig
