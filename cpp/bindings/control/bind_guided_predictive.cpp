// Binds include/mgdd/control/guided_predictive.hpp.
#include <map>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/control/guided_predictive.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace control;

using Levels = std::map<std::string, double>;

Levels levels_of(const PlateBelief<double>& b) {
  return {{"bias_above", b.above.bias},   {"friction_above", b.above.friction},
          {"bias_below", b.below.bias},   {"friction_below", b.below.friction},
          {"gain_factor", b.gain_factor}, {"damping_factor", b.damping_factor}};
}

void start_from(GuidedPredictive& self, const Levels& given) {
  PlateBelief<double> b = self.belief();
  const std::map<std::string, double*> places{{"bias_above", &b.above.bias},   {"friction_above", &b.above.friction},
                                              {"bias_below", &b.below.bias},   {"friction_below", &b.below.friction},
                                              {"gain_factor", &b.gain_factor}, {"damping_factor", &b.damping_factor}};
  for (const auto& [name, value] : given) {
    const auto place = places.find(name);
    if (place == places.end()) {
      throw ParameterError("learnt", name,
                           "must be some of bias_above, friction_above, bias_below, friction_below, "
                           "gain_factor, damping_factor");
    }
    *place->second = value;
  }
  self.set_belief(b);
}

constexpr const char* guided_predictive_doc =
    R"(Model-guided predictive controller of a throttle plate, one sample at a time.

A rough model predicts a short horizon; one Gauss-Newton step per sample moves the last duties along its exact slopes;
what is measured corrects the model while it runs. The default learns dry friction as two levels per side of limp-home,
gain and damping, goes back to the last belief that proved itself where the learnt one predicts worse, asks the model for the duty at which the plate breaks away, and holds still inside the friction band.
``friction_learning=False`` is the plain form, ``prediction="linear"`` the usual linear MPC, more `gauss_newton_steps`
the converged nonlinear one. Keyword-only; the defaults fit the throttle ``P1``. `mgdd.loop.tuned_controller` makes one
for another throttle; ``GuidedPredictive.fields()`` lists bounds and defaults.

Parameters
----------
sample_s : float
    Time between samples [s].
gain_deg_per_s2, time_constant_s : float
    Acceleration per duty [deg/s²] and time constant of the speed [s].
electrical_s : float
    Lag of the motor's torque, L/R [s]; 0 for none.
limp_home_deg, ramp_deg : float
    Rest angle of the springs, and half width over which the preload changes sides [deg].
preload_above, preload_below : float
    Duty against the preload [-].
spring_above_per_deg, spring_below_per_deg : float
    Duty against the springs [1/deg].
friction : float
    Duty against dry friction [-], from which learning starts.
closed_deg, open_deg : float
    Ends of the travel [deg].
prediction_step_s : float
    Step of the horizon [s].
error_weight, speed_weight, duty_change_weight : float
    Of the squared error [1/deg²] and speed [s²/deg²] at each step, and of the squared change of each move [-].
lower, upper, duty_rate_per_s : float
    Bounds of the duty [-] and of its change [1/s], both hard.
lowest_deg, highest_deg, angle_limit_weight : float
    Bounds of the predicted angle [deg], and the price of a squared degree beyond them [1/deg²].
observer_angle_per_s, observer_speed_per_s2 : float
    Sum [1/s] and product [1/s²] of the rates at which errors of the model's angle and speed die, the same at every
    sample time.
noise_deg : float
    Standard deviation of the measured angle [deg]: what counts as motion.
learning_rate_per_s, gain_weight, damping_weight : float
    Learning: share of what explains an innovation, per time [1/s] of a sample up to 1 ms, and the first variances of the factors of gain and
    damping over that of a friction level [-].
level_memory_s, memory_s : float
    Time of sliding after which a friction level, and gain and damping, are as uncertain as at first [s].
least_gain_factor, largest_gain_factor : float
    Bounds of the learnt gain over the given one [-].
rollback_ratio, rollback_s, certify_s : float
    A belief whose squared innovations are larger than those of the certified one by this ratio [-] over the first time
    of sliding [s] is given up for it; one whose are smaller by it over the second time [s] is certified.
bias_rate_per_deg_s, trim_rate_per_deg_s : float
    Without learning: rates of the one bias and of the trim, which the model does not see [1/(deg s)].
reference_lag_s, reference_jump_deg_per_s : float
    Lag of the reference's rate [s]; a faster reference steps and has no rate [deg/s].
prediction : {"nonlinear", "linear"}
    ``linear``: the spring of the measured side without end, friction only fed forward.
switching : {"predicted", "measured"}
    How the prediction knows its side of limp-home.
delay_samples : int
    From a duty to its effect, beside the electrical lag: 0 to 20.
delay_search_samples : int
    With learning: longer delays, by 1 to so many samples, that are tried against the readings beside the given one; 0
    for none, 6 at most.
move_steps : sequence of three int
    Prediction steps for which each duty of the horizon is held; together at most 64.
gauss_newton_steps : int
    At most so many per sample; it ends when the duties stand still.
friction_learning : bool
    Learn friction levels and gain, and use breakaway and hold rules.

Raises
------
mgdd.errors.ParameterError
    A setting outside its domain, naming field, value and bound.

See Also
--------
Mgdd1 : the plainest form, guided by the outputs of any model.
mgdd.loop.tuned_controller : controllers for a throttle, all tuned alike.

References
----------
Tan (2018), Model-Guided Data-Driven Optimization and Control for Internal Combustion Engine Systems, section 7.3.
Diehl, Bock and Schlöder (2005), A real-time iteration scheme for nonlinear optimization in optimal feedback control.

Examples
--------
>>> from mgdd.control import GuidedPredictive
>>> from mgdd.loop import VirtualThrottle
>>> plant, controller, measured_deg = VirtualThrottle(seed=1), GuidedPredictive(), 8.0
>>> for _ in range(120):
...     plant.apply({"duty": controller.step(40.0, measured_deg)})
...     values = plant.measure().values
...     measured_deg = values["sensed_angle_deg"]
>>> abs(values["angle_deg"] - 40.0) < 0.2
True
>>> sorted(controller.learnt)
['bias_above', 'bias_below', 'damping_factor', 'friction_above', 'friction_below', 'gain_factor']
)";

}  // namespace

void bind_guided_predictive(py::module_& m) {
  py::class_<GuidedPredictive> cls(m, "GuidedPredictive", guided_predictive_doc);
  bind_controller(cls, "GuidedPredictive");
  cls.def(
      "step",
      [](GuidedPredictive& self, double reference, double measured, const InputArray& preview) {
        const auto ahead = to_column(preview, "preview_deg");
        return self.step(reference, measured, ahead);
      },
      py::arg("reference_deg"), py::arg("measurement_deg"), py::arg("preview_deg"),
      "The same with the references of the next samples [deg]; a short preview goes on at its last value.");
  cls.def("prepare", &GuidedPredictive::prepare,
          "The part of the next sample that needs no measurement; `step` then does the rest.");
  cls.def("refine", &GuidedPredictive::refine,
          "One more Gauss-Newton step on the last sample, and its duty [-]; feasible after every one.");
  cls.def("reset", &GuidedPredictive::reset, "As made, with what was learnt forgotten.");
  cls.def(
      "set_sent", &GuidedPredictive::set_sent, py::arg("duty"),
      "The duty that was really sent for the last one [-], where a gate or a limiter changed it.\n\nIgnored if it is "
      "not finite; what is clamped without its knowledge looks like a delay to the controller.");
  cls.def("take_over", &GuidedPredictive::take_over, py::arg("measurement_deg"), py::arg("duty"),
          "Start at rest from a duty, what was learnt kept.\n\nIgnored if a number is not finite.");
  cls.def_property(
      "learnt", [](const GuidedPredictive& self) { return levels_of(self.belief()); }, &start_from,
      "Friction levels [-], factors of gain and damping [-] as learnt; setting some or all of them starts from them.");
  cls.def_property_readonly(
      "certified", [](const GuidedPredictive& self) { return levels_of(self.certified()); },
      "The last belief that predicted well for `certify_s`, like `learnt`: a worse one is rolled back to it.");
  cls.def_property_readonly("rollbacks", &GuidedPredictive::rollbacks,
                            "How often a learnt belief was given up for the certified one.");
  cls.def_property_readonly("innovation_deg", &GuidedPredictive::innovation_deg,
                            "Measured less predicted angle of the last sample [deg].");
  cls.def_property_readonly("delay_found_samples", &GuidedPredictive::delay_samples,
                            "Samples from a duty to its effect by which the plate is predicted now: `delay_samples` "
                            "until the readings speak for more.");
  cls.def_property_readonly("holds", &GuidedPredictive::holds, "Whether the plate is held where it is stuck.");
}

}  // namespace mgdd::bindings
