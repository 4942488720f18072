// Binds engine/performance.hpp: terms and their sum J.
#include <optional>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/engine/performance.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

py::dict to_dict(const PerformanceTerm& t) {
  py::dict out;
  out["signal"] = as_str(name_of(t.signal));
  out["weight"] = t.weight;
  out["reference"] = t.reference;
  out["above"] = t.above;
  return out;
}

py::dict to_dict(const Performance& p) {
  py::tuple terms(p.size());
  for (std::size_t i = 0; i < p.size(); ++i)
    terms[i] = p.terms()[i];
  py::dict out;
  out["terms"] = terms;
  return out;
}

// The values that the terms need; others may stand in the dict as well.
PerformanceSignals signals_of(const Performance& p, const py::dict& given) {
  PerformanceSignals signals;
  for (const PerformanceTerm& term : p.terms()) {
    const py::str name = as_str(name_of(term.signal));
    if (!given.contains(name)) {
      throw about("signals",
                  ParameterError("signals lack '" + std::string(name) + "': a term of the performance uses it"));
    }
    signals[term.signal] = as_number(name, given[name]);
  }
  return signals;
}

}  // namespace

void bind_performance(py::module_& m) {
  using py::arg;
  py::class_<PerformanceTerm> term(m, "PerformanceTerm", R"(One term of the performance J of a cycle.

Its value is ``weight * x / reference``; with a limit, ``weight * max(0, (x - above) / above) ** 2``. J is maximised,
so a penalty has a negative weight.

Parameters
----------
signal : str
    ``efficiency_percent``, ``imep_gross_bar``, ``imep_closed_bar``, ``nox_ppm``, ``p_max_bar``,
    ``dp_max_bar_per_cad`` or ``t_max_k``.
weight : float
    Unit of J per unit of x / reference.
reference : float
    > 0, in the unit of the signal; not used by a hinge.
above : float, optional
    Limit > 0 of a hinge, in the unit of the signal.

Raises
------
mgdd.errors.ParameterError
    An unknown signal or a value outside its domain.

Examples
--------
>>> from mgdd.engine import PerformanceTerm
>>> PerformanceTerm("dp_max_bar_per_cad", -2.0, above=10.0).value(15.0)
-0.5
)");
  term.def(py::init([](const std::string& signal, double weight, double reference, std::optional<double> above) {
             const PerformanceTerm made{parse_name<PerformanceSignal>("signal", signal), weight, reference, above};
             static_cast<void>(Performance{made});  // checks the term
             return made;
           }),
           arg("signal"), arg("weight") = 1.0, py::kw_only(), arg("reference") = 1.0, arg("above") = py::none())
      .def_property_readonly(
          "signal", [](const PerformanceTerm& t) { return as_str(name_of(t.signal)); }, "Name of the signal.")
      .def_readonly("weight", &PerformanceTerm::weight, "Unit of J per unit of x / reference.")
      .def_readonly("reference", &PerformanceTerm::reference, "In the unit of the signal.")
      .def_readonly("above", &PerformanceTerm::above, "Limit of a hinge, or None.")
      .def("value", &PerformanceTerm::value, arg("x"), "Value of the term at the signal x.");
  bind_value(term, "PerformanceTerm", [](const PerformanceTerm& self) { return to_dict(self); });

  py::class_<Performance> performance(m, "Performance",
                                      R"(The performance J of a cycle, to be maximised: a sum of one to eight terms.

Parameters
----------
terms : sequence of PerformanceTerm, optional
    Efficiency in percent if left out.

Raises
------
mgdd.errors.ParameterError
    No term, or more than eight.

References
----------
Tan (2018), section 5.3.

Examples
--------
>>> from mgdd.engine import Performance
>>> j = Performance.efficiency_and_nox(0.004)
>>> j.components({"efficiency_percent": 56.0, "nox_ppm": 1500.0})
array([56., -6.])
>>> j.value({"efficiency_percent": 56.0, "nox_ppm": 1500.0})
50.0
)");
  performance
      .def(py::init([](const std::optional<std::vector<PerformanceTerm>>& terms) {
             return terms ? Performance(*terms) : Performance();
           }),
           arg("terms") = py::none())
      .def_static("efficiency_only", &efficiency_only, "J = gross indicated efficiency in percent.")
      .def_static("efficiency_and_nox", &efficiency_and_nox,
                  arg("nox_weight_percent_per_ppm") = default_nox_weight_percent_per_ppm,
                  "J = efficiency in percent - weight * NOx; the weight in %/ppm.")
      .def_property_readonly(
          "terms", [](const Performance& p) { return to_dict(p)["terms"].cast<py::tuple>(); }, "The terms, in order.")
      .def(
          "components",
          [](const Performance& p, const py::dict& given) {
            std::vector<double> out(p.size());
            p.components(signals_of(p, given), out);
            return to_array(out);
          },
          arg("signals"), "Value of each term, from a dict of signals by name.")
      .def(
          "value", [](const Performance& p, const py::dict& given) { return p.value(signals_of(p, given)); },
          arg("signals"), "J, from a dict of signals by name.")
      .def("__len__", &Performance::size);
  bind_value(performance, "Performance", [](const Performance& self) { return to_dict(self); });
}

}  // namespace mgdd::bindings
