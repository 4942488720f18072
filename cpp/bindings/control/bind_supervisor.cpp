// Binds control/supervisor.hpp: what stands between a throttle controller and its bridge.
#include <array>
#include <limits>
#include <optional>
#include <utility>

#include "binding.hpp"
#include "mgdd/control/supervisor.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace control;

std::pair<double, double> observe(ThrottleSupervisor& self, double reference_deg,
                                  const std::array<double, 2>& angles_deg, double age_s, std::optional<double> supply_v,
                                  bool sensor_fault) {
  const SupervisorView view = self.observe({.reference_deg = reference_deg,
                                            .angle_deg = angles_deg,
                                            .age_s = age_s,
                                            .supply_v = supply_v.value_or(std::numeric_limits<double>::quiet_NaN()),
                                            .sensor_fault = sensor_fault});
  return {view.reference_deg, view.angle_deg};
}

}  // namespace

void bind_supervisor(py::module_& m) {
  py::class_<ThrottleSupervisor> cls(m, "ThrottleSupervisor",
                                     R"(Supervisor of a throttle controller: bad input, faults, and the safe state.

Sees every sample before and after the controller. It bridges short gaps (mode ``holding``), limits the reference
(``limited``), and opens the bridge so that the springs bring the plate to limp-home (``limp_home``), within 50 ms of what
it can see. The last two stay until `acknowledge` finds the cause gone. Keyword-only; the defaults fit the throttle
``P1``. ``ThrottleSupervisor.fields()`` lists bounds and defaults. Not a certified safety function.

Parameters
----------
sample_s : float
    Time between samples [s].
closed_deg, open_deg : float
    Travel; the reference is limited to it [deg].
limited_open_deg : float
    Largest reference while the supply is low [deg].
late_s, silence_s : float
    Age beyond which an angle is not used, and time without a usable reference, angle or duty that opens [s].
range_margin_deg, disagreement_deg, sensor_s : float
    What a sensor may say beyond the travel, by what both may differ [deg], and the time of either that opens [s].
nominal_supply_v, supply_low_v, supply_lost_v, supply_s : float
    Supply to which duties belong, below which the reference is limited, below which the bridge opens [V], and for how
    long [s].
limp_home_deg, ramp_deg, preload_above, spring_above_per_deg, preload_below, spring_below_per_deg : float
    The springs in duty, as in `Pid`.
friction : float
    Duty against dry friction at breakaway [-].
gain_deg_per_s2, time_constant_s : float
    Acceleration per duty [deg/s²] and time constant of the speed [s], as in `SlidingMode`.
uncertainty, load : float
    Share by which springs and friction may differ from these, and duty that the air may add [-].
jam_error_deg, jam_move_deg, jam_s : float
    Error that demands a move, and the move [deg] that a pushed plate must make within that time [s].
balance_lag_s, spring_band_deg, spring_evidence_s : float
    Two lags of the balance [s], distance from limp-home without a check of the springs [deg], and the duty beyond what a
    whole spring allows, summed over time, that opens [s].
tracking_error_deg, tracking_s : float
    Error [deg] that must not last [s].
overload_duty, overload_s : float
    Duty [-] that must not last away from the stops [s].
oscillation_deg, oscillation_s : float
    Error [deg] whose side must not change six times in a row, each within that time [s], while the reference stands.
limp_home_band_deg, return_s : float
    The plate is at limp-home so near to it [deg], and must be after that time with the bridge open [s].
healthy_s : float
    Time without any reason before an acknowledgement counts [s].

Raises
------
mgdd.errors.ParameterError
    A setting outside its domain, naming field, value and bound.

See Also
--------
SupervisedController : a controller and its supervisor as one object.
mgdd.loop.ThrottleFault : faults to try it on.

Notes
-----
Reasons: ``missing_reference``, ``reference_range``, ``missing_sample``, ``stale_sample``, ``sensor_range``,
``sensor_disagreement``, ``invalid_duty``, ``supply_low``, ``supply_lost``, ``jammed``, ``spring_lost``, ``tracking``,
``overload`` and ``oscillation``; ``none`` while nothing was wrong since the last acknowledgement.

References
----------
Bosch Motorsport, manual of the MS 6 engine control (sum and range of the sensors).
Ohnishi et al. (1996), Motion control for advanced mechatronics (disturbance observer).
Page (1954), Continuous inspection schemes.

Examples
--------
>>> from mgdd.control import ThrottleSupervisor
>>> supervisor = ThrottleSupervisor()
>>> supervisor.observe(95.0, (60.0, 60.1), supply_v=12.0)
(90.0, 60.0)
>>> supervisor.decide(0.3), supervisor.mode, supervisor.reason
((0.3, False), 'limited', 'reference_range')
)");
  bind_stepped(cls, "ThrottleSupervisor");
  cls.def("observe", &observe, py::arg("reference_deg"), py::arg("angles_deg"), py::kw_only(), py::arg("age_s") = 0.0,
          py::arg("supply_v") = py::none(), py::arg("sensor_fault") = false,
          R"(First half of a sample, before the controller.

Parameters
----------
reference_deg : float
    What is asked for [deg]; NaN where nothing arrived.
angles_deg : pair of float
    What each sensor alone says [deg]; NaN where nothing arrived.
age_s : float
    Age of these angles [s].
supply_v : float, optional
    Supply of the bridge [V]; unknown if left out.
sensor_fault : bool
    From a check of the sensors elsewhere.

Returns
-------
tuple of float
    Reference and angle that the controller shall use [deg].)");
  cls.def(
      "decide",
      [](ThrottleSupervisor& self, double duty) {
        const SupervisorOrder order = self.decide(duty);
        return std::pair{order.duty, order.bridge_open};
      },
      py::arg("duty"),
      "Second half of a sample: duty [-] for the bridge and whether it is open, for the duty that the controller asks "
      "for.");
  cls.def(
      "acknowledge", [](ThrottleSupervisor& self) { return as_str(name_of(self.acknowledge())); },
      "Back to normal where the cause is gone: nothing wrong for `healthy_s`, and an open bridge has brought the plate "
      "to limp-home.\n\nReturns the reason that stands, ``'none'`` where it was accepted.");
  cls.def("reset", &ThrottleSupervisor::reset, "As made.");
  cls.def_property_readonly(
      "mode", [](const ThrottleSupervisor& self) { return as_str(name_of(self.order().mode)); },
      "Mode of the last sample: ``normal``, ``holding``, ``limited`` or ``limp_home``.");
  cls.def_property_readonly(
      "reason", [](const ThrottleSupervisor& self) { return as_str(name_of(self.order().reason)); },
      "Reason of the mode, or the last one since it was acknowledged.");
  cls.def_property_readonly(
      "return_test", [](const ThrottleSupervisor& self) { return as_str(name_of(self.return_test())); },
      "Whether the open bridge has brought the plate to limp-home: ``none`` (not open), ``pending``, ``passed`` or "
      "``failed``.");
  cls.def_property_readonly(
      "duty", [](const ThrottleSupervisor& self) { return self.order().duty; }, "Duty of the last sample [-].");
  cls.def_property_readonly(
      "bridge_open", [](const ThrottleSupervisor& self) { return self.order().bridge_open; },
      "Whether the bridge is open.");
  cls.def_property_readonly("imbalance", &ThrottleSupervisor::imbalance,
                            "Duty that springs, inertia and back-EMF do not explain [-].");
}

}  // namespace mgdd::bindings
