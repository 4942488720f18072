// Binds include/mgdd/throttle/stepper.hpp, behind mgdd.throttle.to_iosystem.
#include <map>
#include <string>

#include "binding.hpp"
#include "mgdd/throttle/models/pseudo_wiener_numbers.hpp"
#include "mgdd/throttle/stepper.hpp"

namespace mgdd::bindings {

using namespace mgdd::throttle;

void bind_stepper(py::module_& m) {
  py::class_<ThrottleStepper>(m, "Stepper",
                              R"(One sample of a throttle from a given state; behind mgdd.throttle.to_iosystem.

The state is angle [deg], speed [deg/s], current [A] and bristle [deg] of motor and gear, then angle, speed and bristle
of the plate.
)")
      .def(py::init<const Throttle&, double, double>(), py::arg("throttle"), py::kw_only(), py::arg("sample_s"),
           py::arg("step_s"))
      .def_static("at_rest", &ThrottleStepper::at_rest, py::arg("angle_deg"),
                  "State at rest at an angle [deg], without current.")
      .def("advance", &ThrottleStepper::advance, py::arg("state"), py::arg("duty"),
           "State after one sample under a duty [-], which is clipped to -1..1.");
  py::class_<PseudoWienerStepper>(
      m, "PseudoWienerStepper",
      "One sample of a pseudo-Wiener model from a given state; behind mgdd.throttle.to_iosystem.")
      .def(py::init([](const std::string& kind, const std::map<std::string, double>& parameters,
                       const std::string& switching, const std::string& friction) {
             return PseudoWienerStepper(pseudo_wiener_from(kind, parameters, switching, friction));
           }),
           py::arg("kind"), py::arg("parameters"), py::kw_only(), py::arg("switching") = "predicted",
           py::arg("friction") = "set_valued")
      .def("at_rest", &PseudoWienerStepper::at_rest, py::arg("angle_deg"), "State at rest at an angle [deg].")
      .def("advance", &PseudoWienerStepper::advance, py::arg("state"), py::arg("duty"),
           "State after one sample under a duty [-].")
      .def("output", &PseudoWienerStepper::output, py::arg("state"), "Angle [deg] of a state.");
}

}  // namespace mgdd::bindings
