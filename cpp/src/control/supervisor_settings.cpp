#include <array>

#include "mgdd/common/error.hpp"
#include "mgdd/control/supervisor.hpp"

namespace mgdd::control {
namespace {

using Sv = SupervisorSettings;

constexpr Domain supervisor_share = closed(0.0, 1.0);
constexpr Domain degrees = closed(-360.0, 360.0);
constexpr Domain width = above(0.0, 1e3);
constexpr Domain time = above(0.0, 60.0);
constexpr Domain volts = closed(0.0, 100.0);

constexpr auto supervisor_table = joined(
    std::array{
        field<&Sv::sample_s>({"sample_s", "s", above(0.0, 1.0), "time between samples"}),
    },
    travel_fields<&Sv::plate>(),
    std::array{
        field<&Sv::limited_open_deg>({"limited_open_deg", "deg", degrees, "largest reference while the supply is low"}),
        field<&Sv::late_s>({"late_s", "s", closed(0.0, 60.0), "age beyond which an angle is not used"}),
        field<&Sv::silence_s>({"silence_s", "s", time, "time without a usable reference, angle or duty: open"}),
        field<&Sv::range_margin_deg>(
            {"range_margin_deg", "deg", width, "a sensor may say so much more than the travel"}),
        field<&Sv::disagreement_deg>({"disagreement_deg", "deg", width, "the sensors may differ by so much"}),
        field<&Sv::sensor_s>({"sensor_s", "s", time, "time that a sensor must be wrong: open"}),
        field<&Sv::nominal_supply_v>({"nominal_supply_v", "V", above(0.0, 100.0), "supply to which duties belong"}),
        field<&Sv::supply_low_v>({"supply_low_v", "V", volts, "a lower supply limits the reference"}),
        field<&Sv::supply_lost_v>({"supply_lost_v", "V", volts, "a lower supply opens the bridge"}),
        field<&Sv::supply_s>({"supply_s", "s", time, "time that the supply must be low"}),
    },
    spring_fields<&Sv::plate>(),
    std::array{field<&Sv::plate, &Plate::friction>(
        {"friction", "-", supervisor_share, "duty against dry friction at breakaway"})},
    motion_fields<&Sv::plate>(),
    std::array{
        field<&Sv::uncertainty>(
            {"uncertainty", "-", closed(0.0, 10.0), "share by which springs and friction may differ"}),
        field<&Sv::load>({"load", "-", supervisor_share, "duty that the air may add"}),
        field<&Sv::jam_error_deg>({"jam_error_deg", "deg", width, "a smaller error does not ask for a move"}),
        field<&Sv::jam_move_deg>({"jam_move_deg", "deg", width, "a plate that moves farther is not jammed"}),
        field<&Sv::jam_s>({"jam_s", "s", time, "time without that move: open"}),
        field<&Sv::balance_lag_s>({"balance_lag_s", "s", above(0.0, 1.0), "each of two lags of the balance"}),
        field<&Sv::spring_band_deg>({"spring_band_deg", "deg", width, "no check of the springs nearer to limp-home"}),
        field<&Sv::spring_evidence_s>(
            {"spring_evidence_s", "s", above(0.0, 60.0), "sum of the duty beyond what a whole spring allows: open"}),
        field<&Sv::tracking_error_deg>({"tracking_error_deg", "deg", width, "error that must not last"}),
        field<&Sv::tracking_s>({"tracking_s", "s", time, "time that it lasts: open"}),
        field<&Sv::overload_duty>(
            {"overload_duty", "-", above(0.0, 1.0), "duty that must not last away from the stops"}),
        field<&Sv::overload_s>({"overload_s", "s", time, "time that it lasts: open"}),
        field<&Sv::oscillation_deg>(
            {"oscillation_deg", "deg", width, "error whose side must not change again and again"}),
        field<&Sv::oscillation_s>({"oscillation_s", "s", time, "longest time between these changes: open"}),
        field<&Sv::limp_home_band_deg>({"limp_home_band_deg", "deg", width, "the plate is at limp-home so near to it"}),
        field<&Sv::return_s>({"return_s", "s", time, "time in which the springs must bring it there"}),
        field<&Sv::healthy_s>({"healthy_s", "s", time, "time without any reason before an acknowledgement counts"}),
    });

}  // namespace

std::span<const Field<SupervisorSettings>> supervisor_fields() noexcept {
  return supervisor_table;
}

void validate(const SupervisorSettings& s) {
  require_fields(supervisor_table, s);
  require_travel(s.plate);
  require_within("limited_open_deg", s.limited_open_deg, s.plate.closed_deg, s.plate.open_deg, "deg");
  require_within("limp_home_deg", s.plate.spring.limp_home_deg, s.plate.closed_deg, s.plate.open_deg, "deg");
  require_within("supply_lost_v", s.supply_lost_v, 0.0, s.supply_low_v, "V");
  require_within("late_s", s.late_s, 0.0, s.silence_s, "s");
}

}  // namespace mgdd::control
