// Binds include/mgdd/control: PID and sliding mode, one sample at a time; and any controller on float.
#include <variant>

#include "binding.hpp"
#include "mgdd/control/guided_predictive.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/control/plate.hpp"
#include "mgdd/control/sliding_mode.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace control;

void bind_plate(py::module_& m) {
  py::class_<Plate> cls(m, "Plate", "What a controller knows of a throttle plate; ``Plate.fields()`` lists it.");
  bind_record(cls, "Plate");
}

void bind_pid(py::module_& m) {
  py::class_<Pid> cls(m, "Pid",
                      R"(PID controller of a throttle plate, one sample at a time.

Gains per side of limp-home, filtered derivative of the measurement, conditional integration, spring and friction
feed-forward, a friction kick and a dead band. Keyword-only; the defaults fit the throttle ``P1``, tuned with its noise
of 0.03 deg and a delay of one sample. ``Pid.fields()`` lists bounds and defaults.

Parameters
----------
sample_s : float
    Time between samples [s].
proportional_above_per_deg, proportional_below_per_deg : float
    Duty per error above and below limp-home [1/deg]; all gains are blended over `ramp_deg` by the measured angle.
integral_above_per_deg_s, integral_below_per_deg_s : float
    Integral gains [1/(deg s)].
derivative_above_s_per_deg, derivative_below_s_per_deg : float
    Duty against the measured speed [s/deg].
derivative_lag_s : float
    Lag of that speed [s].
limp_home_deg, ramp_deg : float
    Rest angle of the springs, and half width over which preload and gains change sides [deg].
preload_above, preload_below : float
    Duty against the preload, fed forward at the reference [-].
spring_above_per_deg, spring_below_per_deg : float
    Duty against the springs [1/deg].
kick, kick_width_deg : float
    Duty towards the reference against stiction [-], and the error at which it is full [deg].
dead_band_deg : float
    Smaller errors count as zero [deg].
integral_window_deg, integral_limit : float
    Only smaller errors are integrated [deg]; bound of the integral [-].
rate_s_per_deg : float
    Duty fed forward per rate of the reference [s/deg].
friction, friction_rate_deg_per_s : float
    Duty in the direction of that rate [-], and the rate at which it is full [deg/s].
reference_lag_s, reference_jump_deg_per_s : float
    Lag of that rate [s]; a faster reference steps and has no rate [deg/s].
lower, upper : float
    Bounds of the duty [-].

Raises
------
mgdd.errors.ParameterError
    A setting outside its domain, naming field, value and bound.

See Also
--------
SlidingMode : the other classic baseline.
mgdd.loop.VirtualThrottle : a plant to run it on.

References
----------
Åström and Hägglund (2006), Advanced PID Control.
Armstrong-Helouvry et al. (1994), A survey of models, analysis tools and compensation methods for the control of
machines with friction.

Examples
--------
>>> from mgdd.control import Pid
>>> from mgdd.loop import VirtualThrottle
>>> plant, pid, measured_deg = VirtualThrottle(seed=1), Pid(), 8.0
>>> for _ in range(300):
...     plant.apply({"duty": pid.step(40.0, measured_deg)})
...     values = plant.measure().values
...     measured_deg = values["sensed_angle_deg"]
>>> abs(values["angle_deg"] - 40.0) < 0.3
True
)");
  bind_controller(cls, "Pid");
  cls.def("reset", py::overload_cast<>(&Pid::reset), "As made: no integral, no rates.");
  cls.def(
      "take_over", py::overload_cast<double, double, double>(&Pid::reset), py::arg("reference_deg"),
      py::arg("measurement_deg"), py::arg("duty"),
      "Start at rest from a duty without a bump, as far as the limit of the integral allows.\n\nIgnored if a number "
      "is not finite.");
  cls.def_property_readonly("integral", &Pid::integral, "Share of the integral in the duty [-].");
}

void bind_sliding_mode(py::module_& m) {
  py::class_<SlidingMode> cls(m, "SlidingMode",
                              R"(Sliding-mode controller of a throttle plate, one sample at a time.

With the angle y, the filtered reference r and e = y - r, the surface is ``s = de/dt + bandwidth_per_s (e +
integral_per_s * integral of e)``. A model of the plate gives the duty that stays on it, `reaching` the duty that gets
there. Keyword-only; the defaults fit the throttle ``P1``. ``SlidingMode.fields()`` lists bounds and defaults.

Parameters
----------
sample_s : float
    Time between samples [s].
gain_deg_per_s2, time_constant_s : float
    Acceleration per duty [deg/s²] and time constant of the speed [s]; G and tau of `mgdd.throttle.PseudoWiener`.
limp_home_deg, ramp_deg : float
    Rest angle of the springs, and half width over which the preload changes sides [deg].
preload_above, preload_below : float
    Duty against the preload, at the measured angle [-].
spring_above_per_deg, spring_below_per_deg : float
    Duty against the springs [1/deg].
friction, friction_rate_deg_per_s : float
    Duty in the direction of the reference's rate [-], and the rate at which it is full [deg/s].
bandwidth_per_s : float
    Decay of the error on the surface [1/s].
integral_per_s, integral_layers : float
    Weight of the integral [1/s]; it grows only while ``|s|`` is below so many layers [-].
reference_pole_per_s : float
    Double pole of the filter of the reference [1/s].
derivative_lag_s : float
    Lag of the measured speed [s].
switching, layer_deg : float
    Duty of the reaching law [-], and the error at which it is full [deg].
root_per_root_deg_per_s, twist_per_s : float
    Super-twisting: duty per root of ``|s|`` [sqrt(s/deg)], and rate of its integral [1/s].
lower, upper : float
    Bounds of the duty [-].
reaching : {"implicit", "boundary_layer", "super_twisting"}
    ``boundary_layer``: ``-switching sat(s/layer)``. ``implicit``: its backward Euler step, which cannot chatter on
    the model however thin the layer. ``super_twisting``: ``-root sqrt|s| sgn s`` and an integral of ``-twist sgn s``.

Raises
------
mgdd.errors.ParameterError
    A setting outside its domain, naming field, value and bound.

See Also
--------
Pid : the other classic baseline.

References
----------
Slotine and Li (1991), Applied Nonlinear Control, chapter 7.
Acary and Brogliato (2010), Implicit Euler numerical scheme and chattering-free implementation of sliding mode systems.
Levant (1993), Sliding order and sliding accuracy in sliding mode control.

Examples
--------
>>> from mgdd.control import SlidingMode
>>> from mgdd.loop import VirtualThrottle
>>> plant, controller, measured_deg = VirtualThrottle(seed=1), SlidingMode(), 8.0
>>> for _ in range(300):
...     plant.apply({"duty": controller.step(40.0, measured_deg)})
...     values = plant.measure().values
...     measured_deg = values["sensed_angle_deg"]
>>> abs(values["angle_deg"] - 40.0) < 0.3
True
)");
  bind_controller(cls, "SlidingMode");
  cls.def("reset", &SlidingMode::reset, "As made: no integral, no rates.");
  cls.def_property_readonly("surface_deg_per_s", &SlidingMode::surface_deg_per_s, "s of the last sample [deg/s].");
}

/// A controller as a target computes it that has floating point of 32 bits only.
struct SinglePrecision {
  std::variant<BasicGuidedPredictive<float>, BasicPid<float>, BasicSlidingMode<float>> controller;
};

}  // namespace

void bind_controllers(py::module_& m) {
  bind_plate(m);
  bind_pid(m);
  bind_sliding_mode(m);
}

void bind_single_precision(py::module_& m) {
  py::class_<SinglePrecision>(m, "SinglePrecision", "A new controller of the same settings on float.")
      .def(py::init([](const GuidedPredictive& c) -> SinglePrecision {
             return {BasicGuidedPredictive<float>(c.settings())};
           }),
           py::arg("controller"))
      .def(py::init([](const Pid& c) -> SinglePrecision { return {BasicPid<float>(c.settings())}; }),
           py::arg("controller"))
      .def(py::init([](const SlidingMode& c) -> SinglePrecision { return {BasicSlidingMode<float>(c.settings())}; }),
           py::arg("controller"))
      .def(
          "step",
          [](SinglePrecision& self, float reference, float measured) {
            return std::visit([&](auto& c) { return c.step(reference, measured); }, self.controller);
          },
          py::arg("reference_deg"), py::arg("measurement_deg"),
          "Duty [-] of this sample; the angles [deg] are rounded.");
}

}  // namespace mgdd::bindings
