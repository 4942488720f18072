// Supervisor of a throttle controller: looks at every sample for bad input and for faults, bridges short gaps, limits
// the reference, and opens the bridge so that the springs bring the plate to limp-home. What it limits or opens stays
// so until `acknowledge` finds the cause gone. Angles in deg, duty -1..1, volts, seconds; `observe` and `decide` are
// noexcept and allocation-free. A monitor of a simulation or a test rig, not a certified safety function.
// Thresholds: sum of sensors 0.2 V of 5 V and range 0.2..4.8 V (Bosch Motorsport, MS 6 manual), 40 deg in limp-home
// mode (ETC benchmark, Berkeley). Balance of the plate: a disturbance observer (Ohnishi et al. 1996) in units of duty;
// its excess is summed (Page 1954).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/control/plate.hpp"
#include "mgdd/dynamics/lag.hpp"

namespace mgdd::control {

enum class SupervisorMode {
  normal,
  holding,    ///< bridges a bad input with the last good one or the other sensor; ends with it
  limited,    ///< the reference is limited; stays until acknowledged
  limp_home,  ///< the bridge is open; stays until acknowledged
};

/// Of two in the mode `limited`, the later one here is reported.
enum class SupervisorReason {
  none,
  missing_reference,  ///< the reference is not finite
  reference_range,    ///< it lies outside the travel
  missing_sample,     ///< no finite angle
  stale_sample,       ///< older than `late_s`
  sensor_range,       ///< a sensor says more than the travel and its margin
  sensor_disagreement,
  invalid_duty,  ///< the controller's duty is not finite
  supply_low,
  supply_lost,
  jammed,       ///< the plate does not move under a duty beyond spring, friction and load
  spring_lost,  ///< the plate does not return under a duty that its spring would beat
  tracking,     ///< the error stays large
  overload,     ///< the duty stays large
  oscillation,  ///< the plate swings about a reference that stands
};

/// Default-spring test: whether the plate is at limp-home with the bridge open.
enum class ReturnTest {
  none,  ///< the bridge is not open
  pending,
  passed,
  failed,  ///< not there after `return_s`: jammed, or its spring is lost
};

struct SupervisorSettings {
  double sample_s = 1e-3;
  Plate plate{.friction = 0.098};  ///< friction at breakaway: P1 with the stiction of controller tests
  double limited_open_deg = 40.0;  ///< upper end of the travel while the supply is low

  // Readings.
  double late_s = 3e-3;            ///< an older angle is not used
  double silence_s = 0.02;         ///< no usable reference, angle or duty for so long: open
  double range_margin_deg = 6.75;  ///< beyond the travel
  double disagreement_deg = 4.5;
  double sensor_s = 0.02;

  double nominal_supply_v = 12.0;
  double supply_low_v = 9.0;   ///< limits
  double supply_lost_v = 6.0;  ///< opens
  double supply_s = 0.02;

  // Of the plate.
  double uncertainty = 0.3;  ///< [-] share by which springs and friction may differ from `plate`
  double load = 0.04;        ///< [-] of the air

  double jam_error_deg = 2.0;
  double jam_move_deg = 0.5;  ///< who moves farther in `jam_s` is not jammed
  double jam_s = 0.04;

  double balance_lag_s = 0.006;     ///< of the balance, twice
  double spring_band_deg = 3.0;     ///< no check of the springs nearer to limp-home
  double spring_evidence_s = 4e-4;  ///< duty beyond what a whole spring allows, summed over time: 0.02 for 20 ms

  double tracking_error_deg = 8.0;
  double tracking_s = 0.5;
  double overload_duty = 0.9;
  double overload_s = 1.0;
  double oscillation_deg = 1.0;  ///< of the error on either side, and what a reference may move that stands
  double oscillation_s = 0.15;   ///< between two sides: hunting by friction and integral is slower

  // With the bridge open.
  double limp_home_band_deg = 1.0;
  double return_s = 0.4;
  double healthy_s = 0.05;  ///< without any reason before an acknowledgement counts

  bool operator==(const SupervisorSettings&) const = default;
};

/// All numbers of the settings, in the order in which Python shows them.
std::span<const Field<SupervisorSettings>> supervisor_fields() noexcept;
inline auto fields_of(const SupervisorSettings&) {
  return supervisor_fields();
}

/// ParameterError naming field, value and bound.
void validate(const SupervisorSettings& settings);

/// One sample as it arrived; NaN is what did not.
struct SupervisorInputs {
  double reference_deg = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 2> angle_deg{};  ///< what each sensor alone says
  double age_s = 0.0;                 ///< of the angles
  double supply_v = std::numeric_limits<double>::quiet_NaN();
  bool sensor_fault = false;  ///< from a check of the sensors elsewhere
};

/// What the controller shall use.
struct SupervisorView {
  double reference_deg, angle_deg;
};

/// What the bridge shall do, and why.
struct SupervisorOrder {
  double duty = 0.0;
  bool bridge_open = false;
  SupervisorMode mode = SupervisorMode::normal;
  SupervisorReason reason = SupervisorReason::none;  ///< of the mode, or the last one since it was acknowledged
};

class ThrottleSupervisor {
 public:
  /// ParameterError for bad settings.
  explicit ThrottleSupervisor(const SupervisorSettings& settings);

  /// First half of a sample, before the controller.
  SupervisorView observe(const SupervisorInputs& inputs) noexcept;
  /// Second half: the duty that the controller asks for.
  SupervisorOrder decide(double duty) noexcept;

  /// Back to normal where the cause is gone: nothing was wrong for `healthy_s`, and an open bridge has brought the
  /// plate to limp-home. Gives the reason that stands, none where it was accepted.
  SupervisorReason acknowledge() noexcept;
  /// As made.
  void reset() noexcept { state_ = State(settings_); }

  const SupervisorSettings& settings() const noexcept { return settings_; }
  const SupervisorOrder& order() const noexcept { return state_.order; }
  ReturnTest return_test() const noexcept { return state_.test; }
  /// Duty that springs, inertia and back-EMF do not explain [-]: friction, load, or a fault.
  double imbalance() const noexcept { return state_.imbalance; }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    auto& s = self.state_;
    visit_enum(v, "mode", s.order.mode);
    visit_enum(v, "reason", s.order.reason);
    visit_enum(v, "latched", s.latched);
    visit_enum(v, "return_test", s.test);
    v("duty", s.order.duty);
    v("bridge_open", s.order.bridge_open);
    v("restricted", s.restricted);
    v("reference_deg", s.reference_deg);
    v("angle_deg", s.angle_deg);
    v("trusted", s.trusted);
    v("silence_s", s.silence_s);
    v("supply_v", s.supply_v);
    v("counts", s.counts);
    v("samples_open", s.open);
    v("samples_quiet", s.quiet);
    v("anchor_deg", s.anchor_deg);
    v("filtering", s.filtering);
    v("filtered", s.filtered);
    v("imbalance", s.imbalance);
    v("evidence_s", s.evidence_s);
    v("last_deg", s.last_deg);
    v("stands_deg", s.stands_deg);
    v("error_side", s.error_side);
    v("side_changes", s.side_changes);
    v("samples_on_side", s.on_side);
  }

 private:
  enum Count : std::uint8_t {
    no_reference,
    no_angle,
    bad_sensor,
    no_duty,
    low,
    lost,  // the last input
    jam,
    too_far_closed,
    too_far_open,
    overload,
    n_counts
  };
  // An input that looks well now and then is as bad; an error or a duty may be large as often as it likes.
  static constexpr bool is_input(Count which) noexcept { return which <= lost; }
  enum Filter : std::uint8_t { angle_once, angle_twice, excess_once, excess_twice, rate, quick_rate, n_filtered };

  /// Everything that changes from sample to sample.
  struct State {
    explicit State(const SupervisorSettings& settings) noexcept;

    SupervisorOrder order{};
    SupervisorMode latched = SupervisorMode::normal;
    ReturnTest test = ReturnTest::none;
    bool restricted = false;                // by the supply
    double reference_deg, angle_deg;        // last good ones
    bool trusted = false;                   // the angle is of now
    double silence_s;                       // since the last angle
    double supply_v;                        // nominal where unknown
    std::array<double, n_counts> counts{};  // failing samples
    double open = 0.0, quiet = 0.0;
    double anchor_deg = 0.0;  // from where a pushed plate has to move
    bool filtering = false;
    std::array<double, n_filtered> filtered{};
    double last_deg = 0.0;
    double imbalance = 0.0, motion = 0.0;  // what is not explained, and what inertia and back-EMF explain
    double evidence_s = 0.0;
    double stands_deg = 0.0;  // the reference since it moved
    double error_side = 0.0, side_changes = 0.0, on_side = 0.0;
  };

  void raise(SupervisorMode mode, SupervisorReason reason) noexcept;
  bool raise_after(Count which, bool failing, double after_s, SupervisorMode mode, SupervisorReason reason) noexcept;
  double usable_reference_deg() const noexcept;
  void look_at_reference(double reference_deg) noexcept;
  void look_at_angles(const SupervisorInputs& inputs) noexcept;
  void look_at_supply(double supply_v) noexcept;
  void look_at_motion() noexcept;
  void follow_balance(double excess) noexcept;
  bool look_for_jam(double duty, double excess, double friction, double known) noexcept;
  void look_for_spring(double known) noexcept;
  void look_for_oscillation(double error) noexcept;
  void test_return() noexcept;

  SupervisorSettings settings_;
  dynamics::LagPair<double> lag_;
  double quick_share_;
  State state_;
};

}  // namespace mgdd::control
