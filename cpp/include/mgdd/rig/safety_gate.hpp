// Safety gate: the last thing a duty passes before it leaves the machine, below every controller and optimiser, on the
// host and on the node. It knows no model of the plant: facts of a cycle in (frames, ages, sensors, bus, deadlines,
// requests of the operator), then the duty that is asked for, and out the drive that may be sent. Outside the state
// `run` the duty is 0 and the bridge open: with a closed bridge zero duty brakes the plate on its way to limp-home. One
// thread; calls are noexcept and allocation-free; equal calls from equal states give equal bits. A monitor of a test
// rig, not a certified safety function: the emergency stop belongs into the supply of the motor.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/rig/safety_audit.hpp"
#include "mgdd/rig/safety_envelope.hpp"

namespace mgdd::rig {

/// What the operator, or the program for him, asks of the gate.
enum class SafetyRequest {
  none,
  arm,     ///< init to armed
  run,     ///< armed to run
  stop,    ///< run to armed
  disarm,  ///< armed or run to init
  reset,   ///< limp to armed, fault to init
  abort,   ///< armed or run to limp
};

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// What is known of a cycle; the defaults are of one in which nothing arrived and all else is well.
struct SafetyFacts {
  std::int64_t good_frames = 0, bad_frames = 0;      ///< that arrived since the last cycle, in whatever order
  double age_s = unknown;                            ///< of the last good one; NaN: it grows by the cycle
  std::array<double, 2> sensor_v{unknown, unknown};  ///< of both position sensors; looked at where a good frame arrived
  double angle_deg = unknown;                        ///< of the plate; the same
  BusState bus = BusState::active;
  bool sent = true;                   ///< the last command left
  std::int64_t missed_deadlines = 0;  ///< since the last cycle
  SafetyRequest request = SafetyRequest::none;
};

/// What may leave the machine.
struct Drive {
  double duty = 0.0;
  bool bridge_open = true;
  bool send = true;  ///< false while the bus is off: a frame would only wait there

  bool operator==(const Drive&) const = default;
};

class SafetyGate {
 public:
  /// ParameterError for a bad envelope.
  explicit SafetyGate(const SafetyEnvelope& envelope);

  /// First half of a cycle, before the controller.
  void observe(const SafetyFacts& facts) noexcept;
  /// Second half: the duty that the controller asks for.
  Drive command(double duty) noexcept;

  /// A request between two cycles; those of the facts come here too. Gives what stands against it, none where it was
  /// accepted.
  SafetyReason request(SafetyRequest request) noexcept;

  SafetyState state() const noexcept { return s_.state; }
  /// Why that state was entered.
  SafetyReason reason() const noexcept { return s_.reason; }
  /// What is wrong now; a request of `arm`, `run` or `reset` waits for its end.
  SafetyReason cause() const noexcept { return s_.cause; }
  Drive drive() const noexcept {
    const bool driven = s_.state == SafetyState::run;
    return {driven ? s_.duty : 0.0, !driven, s_.send};
  }
  double rms_duty() const noexcept;
  std::int64_t cycle() const noexcept { return s_.cycle; }
  /// Changes of state for this reason.
  std::int64_t count(SafetyReason reason) const noexcept;
  /// Duties that were beyond the limit, and that changed too fast.
  std::int64_t clamped() const noexcept { return s_.clamped; }
  std::int64_t slewed() const noexcept { return s_.slewed; }
  SafetyAudit& audit() noexcept { return s_.audit; }
  const SafetyEnvelope& envelope() const noexcept { return envelope_; }

  /// ParameterError for a restored state that this envelope does not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    auto& s = self.s_;
    visit_enum(v, "state", s.state);
    visit_enum(v, "reason", s.reason);
    visit_enum(v, "cause", s.cause);
    visit_enum(v, "sensor_cause", s.sensor_cause);
    v("cycle", s.cycle, counts_end);
    v("observed", s.observed);
    v("holding", s.holding);
    v("send", s.send);
    v("duty", s.duty);
    v("heat", s.heat);
    v("hot", s.hot);
    v("silence_s", s.silence_s);
    v("angle_deg", s.angle_deg);
    v("anchor_deg", s.anchor_deg);
    v("sensor_v", s.sensor_v);
    v("since_sensor", s.since_sensor);
    v("streaks", s.streaks);
    v("healthy_frames", s.healthy);
    v("running", s.running);
    v("clamped", s.clamped, counts_end);
    v("slewed", s.slewed, counts_end);
    v("counts", s.counts);
    SafetyAudit::visit(s.audit, v);
  }

 private:
  enum Streak : std::uint8_t { stale, bad, missed, unsent, sensor, still, invalid, n_streaks };

  /// Everything that changes from cycle to cycle.
  struct Memory {
    SafetyState state = SafetyState::init;
    SafetyReason reason = SafetyReason::none, cause = SafetyReason::none;
    SafetyReason sensor_cause = SafetyReason::none;
    std::int64_t cycle = 0;
    bool observed = false, holding = false, send = true;
    double duty = 0.0;                         // that leaves; 0 unless driven
    double heat = 0.0;                         // mean square of the duty
    bool hot = false;                          // until it has cooled
    double silence_s = 0.0;                    // since the last good frame
    double angle_deg = 0.0, anchor_deg = 0.0;  // and from where a pushed plate has to move
    std::array<double, 2> sensor_v{};          // last ones that a slope could reach
    std::array<double, 2> since_sensor{};      // cycles since; negative before the first
    std::array<double, n_streaks> streaks{};   // cycles or frames in a row
    double healthy = 0.0;                      // good frames since something was wrong
    double running = 0.0;                      // cycles since the start
    std::int64_t clamped = 0, slewed = 0;
    std::array<double, n_safety_reasons> counts{};
    SafetyAudit audit;
  };

  void enter(SafetyState to, SafetyReason reason) noexcept;
  void note(SafetyReason reason) noexcept;
  void note_after(Streak which, double growth, bool failing, double most, SafetyReason reason) noexcept;
  void react() noexcept;
  SafetyReason readiness() const noexcept;
  SafetyReason move_on(bool allowed, SafetyState to) noexcept;
  void look_at_frames(const SafetyFacts& facts, double cycles) noexcept;
  void look_at_sensors(const SafetyFacts& facts, double cycles) noexcept;
  void look_at_motor(double cycles) noexcept;
  double limited(double duty) noexcept;

  SafetyEnvelope envelope_;
  Memory s_;
};

}  // namespace mgdd::rig
