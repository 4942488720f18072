// Safety envelope: the numbers of a safety gate (rig/safety_gate.hpp), all that may leave the machine towards an
// actuator and all that must be true of its measurements. Duty -1..1, angles in deg, volts, seconds; a cycle is
// `cycle_s`. Sum of sensors 0.2 V of 5 V and range 0.2 to 4.8 V: Bosch Motorsport, manual of the MS 6; all else is
// ours. Offline code.
#pragma once

#include <cstddef>
#include <span>
#include <tuple>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"

namespace mgdd::rig {

/// Error state of a CAN controller (ISO 11898-1); a worse one is larger.
enum class BusState { active, warning, passive, off };

struct SafetyEnvelope {
  double cycle_s = 1e-3;

  // The duty.
  double duty_limit = 0.8;
  double slew_per_s = 200.0;
  double ramp_s = 0.2;          ///< after the start the duty grows in, without a jerk
  double invalid_duties = 1.0;  ///< that are not finite, in a row; the last good one is held before

  // Heat: duty² through a lag.
  double rms_duty_limit = 0.5;
  double rms_duty_to_arm = 0.4;
  double heat_time_constant_s = 10.0;

  // Stall.
  double stall_duty = 0.6;
  double stall_move_deg = 0.5;
  double stall_s = 0.2;

  // Frames and cycles.
  double largest_age_cycles = 3.0;
  double held_cycles = 1.0;   ///< that an older measurement is bridged with the last duty
  double bad_frames = 3.0;    ///< in a row
  double good_frames = 20.0;  ///< before arming and before a reset, with nothing wrong meanwhile
  double missed_deadlines = 3.0;
  double unsent_cycles = 3.0;
  BusState bus_fault_from = BusState::passive;

  // Both sensors and the plate.
  double sensor_sum_v = 5.0;
  double sensor_sum_tolerance_v = 0.2;
  double sensor_low_v = 0.2;
  double sensor_high_v = 4.8;
  double sensor_slope_v_per_s = 400.0;
  double sensor_cycles = 4.0;
  double closed_deg = 0.0, open_deg = 90.0;
  double travel_margin_deg = 6.75;

  bool operator==(const SafetyEnvelope&) const = default;
};

/// All numbers of the envelope, in the order in which Python and the files show them.
std::span<const Field<SafetyEnvelope>> envelope_fields() noexcept;
inline auto fields_of(const SafetyEnvelope&) {
  return std::tuple{envelope_fields(), field<&SafetyEnvelope::bus_fault_from>(
                                           "bus_fault_from", "state of the CAN controller from which on it is limp")};
}

/// ParameterError naming field, value and bound.
void validate(const SafetyEnvelope& envelope);

}  // namespace mgdd::rig
