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

/// Name and limit, and what is not as by default.
py::str limit_text(const Limit& l) {
  const Limit standard;
  py::str out = py::str("Limit({!r}, {!r}").format(l.name, l.upper);
  const auto add = [&](const char* name, const auto& value, const auto& usual) {
    if (value != usual) out = py::str("{}, {}={!r}").format(out, name, value);
  };
  add("margin", l.margin, standard.margin);
  add("method", std::string(to_string(l.method)), std::string(to_string(standard.method)));
  add("weight", l.weight, standard.weight);
  add("scale", l.scale, standard.scale);
  add("delay_cycles", l.lag.delay_cycles, standard.lag.delay_cycles);
  add("lag_cycles", l.lag.lag_cycles, standard.lag.lag_cycles);
  add("margin_sd", l.margin_sd, standard.margin_sd);
  add("delay_uncertainty", l.delay_uncertainty, standard.delay_uncertainty);
  return py::str("{})").format(out);
}

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
delay_cycles : float
    Transport delay of the reading [cycles].
lag_cycles : float
    Time constant of its first-order lag [cycles], as in `ComponentLag`. Every reading is judged on the input that caused
    it: what was applied `delay_cycles` ago, passed through the same lag.
margin_sd : float
    Added to `margin`: this many standard deviations of the reading about the local model that the seeker learns of it.
    Without any, an estimate at the limit is above it in 5 to 25 % of the cycles; with one in less than 1 %.
    Where more readings lie above than this margin lets expect, it grows by as much as five deviations more.
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
)")
      .def(py::init([](std::string name, double upper, double margin, const std::string& method, double weight,
                       double scale, double delay_cycles, double lag_cycles, double margin_sd, int delay_uncertainty) {
             const ComponentLag lag{delay_cycles, lag_cycles};
             Limit limit{std::move(name), upper, margin,    parse_limit_method(method), weight,
                         scale,           lag,   margin_sd, delay_uncertainty};
             validate({limit});
             return limit;
           }),
           py::arg("name"), py::arg("upper"), py::kw_only(), py::arg("margin") = 0.0, py::arg("method") = "switching",
           py::arg("weight") = 1.0, py::arg("scale") = 0.0, py::arg("delay_cycles") = 0.0, py::arg("lag_cycles") = 0.0,
           py::arg("margin_sd") = Limit{}.margin_sd, py::arg("delay_uncertainty") = Limit{}.delay_uncertainty)
      .def_readonly("name", &Limit::name, "What is limited.")
      .def_readonly("upper", &Limit::upper, "The limit.")
      .def_readonly("margin", &Limit::margin, "Kept free below the limit.")
      .def_property_readonly(
          "method", [](const Limit& l) { return std::string(to_string(l.method)); }, "How J knows of the limit.")
      .def_readonly("weight", &Limit::weight, "Of penalty or barrier.")
      .def_readonly("scale", &Limit::scale, "Unit of the excess.")
      .def_property_readonly(
          "delay_cycles", [](const Limit& l) { return l.lag.delay_cycles; }, "Transport delay of the reading.")
      .def_property_readonly(
          "lag_cycles", [](const Limit& l) { return l.lag.lag_cycles; }, "Time constant of its lag.")
      .def_readonly("margin_sd", &Limit::margin_sd, "Margin in standard deviations of the reading.")
      .def_readonly("delay_uncertainty", &Limit::delay_uncertainty, "Cycles that the delay may be off to either side.")
      .def(
          "__eq__", [](const Limit& a, const Limit& b) { return a == b; }, py::is_operator())
      .def("__repr__", &limit_text)
      .def(py::pickle(
          [](const Limit& l) {
            return py::make_tuple(l.name, l.upper, l.margin, std::string(to_string(l.method)), l.weight, l.scale,
                                  l.lag.delay_cycles, l.lag.lag_cycles, l.margin_sd, l.delay_uncertainty);
          },
          [](const py::tuple& t) {
            const auto number = [&](std::size_t at) { return t[at].cast<double>(); };
            const LimitMethod method = parse_limit_method(t[3].cast<std::string>());
            const ComponentLag lag{number(6), number(7)};
            return Limit{t[0].cast<std::string>(), number(1), number(2), method, number(4), number(5), lag, number(8),
                         t[9].cast<int>()};
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
