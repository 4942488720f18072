#include "mgdd/rig/safety_envelope.hpp"

#include <array>
#include <string_view>

#include "mgdd/common/text.hpp"

namespace mgdd::rig {
namespace {

using E = SafetyEnvelope;

constexpr Domain count = closed(1.0, 1e6);
constexpr Domain volts = closed(0.0, 100.0);

constexpr std::array fields{
    field<&E::cycle_s>({"cycle_s", "s", closed(1e-5, 1.0), "time between two cycles of the gate"}),
    field<&E::duty_limit>({"duty_limit", "-", above(0.0, 1.0), "largest duty"}),
    field<&E::slew_per_s>({"slew_per_s", "1/s", above(0.0, 1e6), "largest change of the duty"}),
    field<&E::ramp_s>({"ramp_s", "s", closed(0.0, 60.0), "time in which the duty grows in after the start"}),
    field<&E::invalid_duties>({"invalid_duties", "cycles", count, "duties in a row that are not finite: FAULT"}),
    field<&E::rms_duty_limit>({"rms_duty_limit", "-", above(0.0, 1.0), "largest RMS duty of the heat model: LIMP"}),
    field<&E::rms_duty_to_arm>({"rms_duty_to_arm", "-", above(0.0, 1.0), "RMS duty to which it cools before arming"}),
    field<&E::heat_time_constant_s>({"heat_time_constant_s", "s", closed(1e-3, 1e5), "lag of the heat model"}),
    field<&E::stall_duty>({"stall_duty", "-", above(0.0, 1.0), "duty that must move the plate"}),
    field<&E::stall_move_deg>({"stall_move_deg", "deg", above(0.0, 360.0), "motion that it must make"}),
    field<&E::stall_s>({"stall_s", "s", above(0.0, 60.0), "time without that motion: LIMP"}),
    field<&E::largest_age_cycles>(
        {"largest_age_cycles", "cycles", count, "age beyond which a measurement is not used"}),
    field<&E::held_cycles>(
        {"held_cycles", "cycles", closed(0.0, 1e6), "cycles for which the last duty bridges it, then LIMP"}),
    field<&E::bad_frames>({"bad_frames", "-", count, "bad frames in a row: LIMP"}),
    field<&E::good_frames>({"good_frames", "-", count, "good frames before arming and before a reset"}),
    field<&E::missed_deadlines>({"missed_deadlines", "-", count, "deadlines missed in a row: LIMP"}),
    field<&E::unsent_cycles>({"unsent_cycles", "cycles", count, "commands in a row that did not leave: LIMP"}),
    field<&E::sensor_sum_v>({"sensor_sum_v", "V", volts, "sum of both sensors"}),
    field<&E::sensor_sum_tolerance_v>({"sensor_sum_tolerance_v", "V", above(0.0, 100.0), "by which it may be off"}),
    field<&E::sensor_low_v>({"sensor_low_v", "V", volts, "least voltage of a healthy sensor"}),
    field<&E::sensor_high_v>({"sensor_high_v", "V", volts, "largest voltage of a healthy sensor"}),
    field<&E::sensor_slope_v_per_s>({"sensor_slope_v_per_s", "V/s", above(0.0), "fastest change of a healthy sensor"}),
    field<&E::sensor_cycles>(
        {"sensor_cycles", "cycles", count, "measurements in a row that fail a check of the sensors: FAULT"}),
    field<&E::closed_deg>({"closed_deg", "deg", closed(-360.0, 360.0), "lower end of the travel"}),
    field<&E::open_deg>({"open_deg", "deg", closed(-360.0, 360.0), "upper end of the travel"}),
    field<&E::travel_margin_deg>({"travel_margin_deg", "deg", closed(0.0, 360.0), "by which an angle may leave it"}),
};

void require_below(std::string_view name, double value, std::string_view other, double bound, std::string_view unit) {
  if (value < bound) return;
  throw ParameterError(name, value, "must be < " + std::string(other) + " = " + text(bound), unit);
}

}  // namespace

std::span<const Field<SafetyEnvelope>> envelope_fields() noexcept {
  return fields;
}

void validate(const SafetyEnvelope& e) {
  require_fields(fields, e);
  require_below("sensor_low_v", e.sensor_low_v, "sensor_high_v", e.sensor_high_v, "V");
  require_below("closed_deg", e.closed_deg, "open_deg", e.open_deg, "deg");
  require_within("rms_duty_to_arm", e.rms_duty_to_arm, 0.0, e.rms_duty_limit);
  if (e.bus_fault_from == BusState::active) {
    throw ParameterError("bus_fault_from", name_of(e.bus_fault_from),
                         "must be warning, passive or off: a healthy bus is active");
  }
}

}  // namespace mgdd::rig
