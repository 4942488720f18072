// Binds include/mgdd/optimize: measured limits, and what stands between the plant and a component of J.
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/optimize/seekers/constraint_filter.hpp"
#include "mgdd/optimize/seekers/dither.hpp"

namespace mgdd::bindings {
namespace {

using namespace optimize;

void bind_limit(py::module_& m) {
  py::class_<Limit>(m, "Limit", R"(An upper limit on a measured quantity, kept by a seeker.

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

Raises
------
mgdd.errors.ParameterError
    When a seeker is made with it: limit not finite, negative margin, weight not > 0.

Examples
--------
>>> from mgdd.optimize import Limit
>>> Limit("p_max_bar", 95.0, margin=1.0)
Limit('p_max_bar', 95.0, margin=1.0, method='switching', weight=1.0, scale=0.0)
)")
      .def(py::init([](std::string name, double upper, double margin, const std::string& method, double weight,
                       double scale) {
             Limit limit{std::move(name), upper, margin, parse_limit_method(method), weight, scale};
             validate({limit});
             return limit;
           }),
           py::arg("name"), py::arg("upper"), py::kw_only(), py::arg("margin") = 0.0, py::arg("method") = "switching",
           py::arg("weight") = 1.0, py::arg("scale") = 0.0)
      .def_readonly("name", &Limit::name, "What is limited.")
      .def_readonly("upper", &Limit::upper, "The limit.")
      .def_readonly("margin", &Limit::margin, "Kept free below the limit.")
      .def_property_readonly(
          "method", [](const Limit& l) { return std::string(to_string(l.method)); }, "How J knows of the limit.")
      .def_readonly("weight", &Limit::weight, "Of penalty or barrier.")
      .def_readonly("scale", &Limit::scale, "Unit of the excess.")
      .def(
          "__eq__", [](const Limit& a, const Limit& b) { return a == b; }, py::is_operator())
      .def("__repr__",
           [](const Limit& l) {
             return py::str("Limit({!r}, {!r}, margin={!r}, method={!r}, weight={!r}, scale={!r})")
                 .format(l.name, l.upper, l.margin, std::string(to_string(l.method)), l.weight, l.scale);
           })
      .def(py::pickle(
          [](const Limit& l) {
            return py::make_tuple(l.name, l.upper, l.margin, std::string(to_string(l.method)), l.weight, l.scale);
          },
          [](const py::tuple& t) {
            return Limit{t[0].cast<std::string>(), t[1].cast<double>(),
                         t[2].cast<double>(),      parse_limit_method(t[3].cast<std::string>()),
                         t[4].cast<double>(),      t[5].cast<double>()};
          }));
}

void bind_component_lag(py::module_& m) {
  py::class_<ComponentLag>(m, "ComponentLag", R"(What stands between the plant and one measured component of J.

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
)")
      .def(py::init([](double delay, double lag) {
             const ComponentLag out{delay, lag};
             validate(std::vector<ComponentLag>{out});
             return out;
           }),
           py::kw_only(), py::arg("delay_cycles") = 0.0, py::arg("lag_cycles") = 0.0)
      .def_readonly("delay_cycles", &ComponentLag::delay_cycles, "Transport delay [cycles].")
      .def_readonly("lag_cycles", &ComponentLag::lag_cycles, "Time constant of the lag [cycles].")
      .def(
          "response",
          [](const ComponentLag& self, int period, int harmonic) {
            if (period < 1 || harmonic < 1) throw ParameterError("period and harmonic: must be >= 1");
            const SensorResponse r = sensor_response(self, harmonic, period);
            return std::pair(r.gain, r.phase_rad * 180.0 / std::numbers::pi);
          },
          py::kw_only(), py::arg("period"), py::arg("harmonic") = 1,
          "Gain [-] and phase lag [deg] at `harmonic` oscillations per `period` cycles.")
      .def(
          "__eq__", [](const ComponentLag& a, const ComponentLag& b) { return a == b; }, py::is_operator())
      .def("__repr__",
           [](const ComponentLag& l) {
             return py::str("ComponentLag(delay_cycles={!r}, lag_cycles={!r})").format(l.delay_cycles, l.lag_cycles);
           })
      .def(py::pickle([](const ComponentLag& l) { return py::make_tuple(l.delay_cycles, l.lag_cycles); },
                      [](const py::tuple& t) { return ComponentLag{t[0].cast<double>(), t[1].cast<double>()}; }));
}

}  // namespace

void bind_limits(py::module_& m) {
  bind_limit(m);
  bind_component_lag(m);
}

}  // namespace mgdd::bindings
