// The one door to pybind11: headers, the array helpers and the bind_<room> functions that module.cpp calls.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace mgdd::bindings {

namespace py = pybind11;

/// One-dimensional input: anything np.asarray takes is copied into a column, so the caller's array stays untouched.
using InputArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::vector<double> to_column(const InputArray& array, std::string_view name);

/// Text of a name in the core.
inline py::str as_str(std::string_view s) {
  return {s.data(), s.size()};
}

/// DataError unless the pickle is ours.
void require_pickle_version(const py::tuple& state);

/// `Name(key=value, ...)` of a dict of constructor keywords.
py::str representation(const char* name, const py::dict& keywords);

/// Equality, hash, text, `to_dict` and pickle of an immutable record that its dict of keywords builds again.
template <class Record, class ToDict>
void bind_value(py::class_<Record>& cls, const char* name, ToDict to_dict) {
  cls.def(
      "to_dict", [to_dict](const Record& self) -> py::dict { return to_dict(self); },
      "Constructor keywords as a new dict.");
  cls.def("__eq__", [](const Record& self, const py::object& other) {
    return py::isinstance<Record>(other) && self == other.cast<const Record&>();
  });
  cls.def("__hash__", [to_dict](const Record& self) { return py::hash(py::tuple(to_dict(self).attr("values")())); });
  cls.def("__repr__", [name, to_dict](const Record& self) { return representation(name, to_dict(self)); });
  cls.def(py::pickle([to_dict](const Record& self) { return py::make_tuple(1, to_dict(self)); },
                     [](const py::tuple& state) {
                       require_pickle_version(state);
                       return py::type::of<Record>()(**state[1].cast<py::dict>()).template cast<Record>();
                     }));
}

/// A new NumPy array that owns a copy of the numbers.
py::array_t<double> to_array(const std::vector<double>& column);

void bind_errors(py::module_& m);
void bind_optimize(py::module_& m);
void bind_limits(py::module_& m);
void bind_seekers(py::module_& m);
void bind_direct_seekers(py::module_& m);
void bind_learning(py::module_& m);
void bind_cylinder(py::module_& m);
void bind_emissions(py::module_& m);
void bind_engine(py::module_& m);
void bind_performance(py::module_& m);
void bind_bench(py::module_& m);
void bind_loop(py::module_& m);
void bind_virtual_throttle(py::module_& m);
void bind_trace(py::module_& m);
void bind_identify(py::module_& m);
void bind_pseudo_wiener(py::module_& m);
void bind_recursive(py::module_& m);
void bind_benchmark_models(py::module_& m);
void bind_throttle(py::module_& m);
void bind_sensors(py::module_& m);
void bind_throttle_step(py::module_& m);
void bind_identify_throttle(py::module_& m);

}  // namespace mgdd::bindings
