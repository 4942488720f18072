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

/// A new NumPy array that owns a copy of the numbers.
py::array_t<double> to_array(const std::vector<double>& column);

void bind_errors(py::module_& m);
void bind_optimize(py::module_& m);
void bind_learning(py::module_& m);
void bind_cylinder(py::module_& m);
void bind_engine(py::module_& m);
void bind_trace(py::module_& m);
void bind_identify(py::module_& m);

}  // namespace mgdd::bindings
