// Binds include/mgdd/optimize: measured limits, and what stands between the plant and a component of J.
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/optimize/laws/dither.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace optimize;

void bind_input(py::module_& m) {
  py::class_<Input> cls(m, "Input", R"(One input of a plant: its name, unit and bounds, and what counts as a step of it.

Parameters
----------
name : str
    What is set, for example ``soc_cad``; plants with this input are steered by it.
lower, upper : float
    What may be applied, in the unit of the input; infinite for none.
unit : str
    Of the input; empty for the one that the name says.
scale : float
    What dithers, perturbations and tolerances of a seeker count in where they are left open, in the unit of the input;
    0 for a fortieth of the bounds, or 1 where there are none.
rate : float
    Largest change of the estimate per step of the seeker, in the unit of the input, > 0.
step : float
    Resolution in which it is set, in the unit of the input: the lower bound and whole steps above it, or multiples
    where there is no lower bound; 0 where any value can be set. Every input that a seeker asks for is on a step; its
    estimate may be between two, `settable` of the seeker is not.

Raises
------
mgdd.errors.ParameterError
    An empty name, bounds that do not enclose anything, a negative scale, a rate that is not > 0, or a step that is
    negative or larger than the bounds are apart.

Examples
--------
>>> from mgdd.optimize import Input, Spsa
>>> seeker = Spsa(start={"soc_cad": -8.0, "egr": 0.1}, inputs=[Input("soc_cad", -20.0, 5.0), Input("egr", 0.0, 0.4)])
>>> sorted(seeker.ask())
['egr', 'soc_cad']
)");
  bind_record(cls, "Input", [](const Input& input) { validate(std::vector<Input>{input}); }, 3);
  cls.def(
      "nearest",
      [](const Input& input, double value) {
        return steps_of({input}).nearest(scalar_input(value), [](const Inputs&) { return 0.0; })[0];
      },
      py::arg("value"), "The nearest value that can be set.");
}

void bind_limit(py::module_& m) {
  py::class_<Limit> cls(m, "Limit", R"(An upper limit on a measured quantity, kept by a seeker.

Parameters
----------
name : str
    What is limited, for example ``p_max_bar``.
upper : float
    The limit, in the unit of the quantity.
margin : float
    Kept free below the limit, same unit.
method : {"switching", "penalty", "barrier"}
    How J knows of the limit: not at all (the guard alone turns the steps), by a quadratic penalty on the excess, or
    by a logarithmic barrier. The guard acts in all three.
weight : float
    Penalty: J units per squared scaled excess; barrier: J units times the logarithm of the scaled room.
scale : float
    Unit of the excess; 0 stands for the limit itself.
delay_cycles : float
    Transport delay of the reading [cycles].
lag_cycles : float
    Time constant of its first-order lag [cycles], as in `ComponentLag`. Every reading is judged on the input that caused
    it: what was applied `delay_cycles` ago, passed through the same lag.
margin_sd : float
    Added to `margin`: this many standard deviations of the reading about the local model that the seeker learns of it.
    Without any, an estimate at the limit is above it in 5 to 25 % of the cycles; with one in less than 1 %.
    Where more readings lie above than this margin lets expect, it grows by as much as five deviations more.
    `GaussianProcessSeeking` keeps a limit by its ``limit_probability`` instead.
delay_uncertainty : int
    `delay_cycles` may be off by as many cycles to either side: the delay that foretells the readings clearly better is
    taken instead, and the ``findings`` of the seeker say so. 0: the stated one is exact.

Raises
------
mgdd.errors.ParameterError
    Limit not finite, negative margin, delay or lag, weight not > 0, ``margin_sd`` outside [0, 100],
    ``delay_uncertainty`` outside [0, 20].

Examples
--------
>>> from mgdd.optimize import Limit
>>> Limit("p_max_bar", 95.0, margin=1.0)
Limit('p_max_bar', 95.0, margin=1.0)
)");
  bind_record(cls, "Limit", [](const Limit& limit) { validate({limit}); }, 2);
}

void bind_component_lag(py::module_& m) {
  py::class_<ComponentLag> cls(m, "ComponentLag", R"(What stands between the plant and one measured component of J.

Parameters
----------
delay_cycles : float
    Transport delay [cycles].
lag_cycles : float
    Time constant of the first-order lag y += (1 - exp(-1/tau)) (x - y) [cycles]; 0 for none.

Raises
------
mgdd.errors.ParameterError
    A negative delay or lag.

Examples
--------
>>> from mgdd.optimize import ComponentLag
>>> gain, phase_deg = ComponentLag(delay_cycles=42, lag_cycles=25).response(period=10)
>>> round(gain, 4), round(phase_deg % 360.0, 1)
(0.0646, 140.5)
)");
  bind_record(cls, "ComponentLag", [](const ComponentLag& lag) { validate(std::vector<ComponentLag>{lag}); });
  cls.def(
      "response",
      [](const ComponentLag& self, int period, int harmonic) {
        if (period < 1 || harmonic < 1) throw ParameterError("period and harmonic: must be >= 1");
        const SensorResponse r = sensor_response(self, harmonic, period);
        return std::pair(r.gain, r.phase_rad * 180.0 / std::numbers::pi);
      },
      py::kw_only(), py::arg("period"), py::arg("harmonic") = 1,
      "Gain [-] and phase lag [deg] at `harmonic` oscillations per `period` cycles.");
}

}  // namespace

void bind_limits(py::module_& m) {
  bind_input(m);
  bind_limit(m);
  bind_component_lag(m);
}

}  // namespace mgdd::bindings
