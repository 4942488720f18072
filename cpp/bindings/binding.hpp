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
#include <type_traits>
#include <utility>
#include <vector>

namespace mgdd::bindings {

namespace py = pybind11;

/// One-dimensional input: anything np.asarray takes is copied into a column, so the caller's array stays untouched.
/// Aligned: an array over a buffer that was received may begin at any byte, and reading a double there is undefined.
using InputArray =
    py::array_t<double, py::array::c_style | py::array::forcecast | py::detail::npy_api::NPY_ARRAY_ALIGNED_>;

std::vector<double> to_column(const InputArray& array, std::string_view name);

/// mgdd.errors.ParameterError `name = value: must be bound`, for what only Python can show.
[[noreturn]] void refuse(const std::string& name, const py::handle& value, const std::string& bound);

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

/// What `work()` gives, computed without the GIL.
template <class Work>
auto without_gil(Work work) {
  const py::gil_scoped_release release;
  return work();
}

/// `f(x)` of every element, without the GIL; a number gives a number, an array one of its shape.
template <class F>
py::object elementwise(F f, const InputArray& x) {
  if (x.ndim() == 0) return py::float_(f(*x.data()));
  py::array_t<double> out(std::vector<py::ssize_t>(x.shape(), x.shape() + x.ndim()));
  const double* from = x.data();
  double* to = out.mutable_data();
  {
    const py::gil_scoped_release release;
    for (py::ssize_t i = 0; i < x.size(); ++i)
      to[i] = f(from[i]);
  }
  return out;
}

/// The same of several arrays that NumPy broadcasts together.
template <class F, class... Arrays>
py::object elementwise(F f, const InputArray& first, const Arrays&... rest) {
  const py::tuple wide(py::module_::import("numpy").attr("broadcast_arrays")(first, rest...));
  std::vector<InputArray> columns;
  for (const py::handle& array : wide)
    columns.emplace_back(py::reinterpret_borrow<py::object>(array));
  std::size_t element = 0;
  const auto at = [&]<std::size_t... I>(std::index_sequence<I...>) { return f(columns[I].data()[element]...); };
  const auto next = [&](double) {
    const double value = at(std::make_index_sequence<1 + sizeof...(rest)>{});
    ++element;
    return value;
  };
  return elementwise(next, columns.front());
}

/// A function of numbers as one of arrays.
template <auto f>
auto over() {
  return []<class... Number>(double (*)(Number...)) {
    return [](const std::conditional_t<true, InputArray, Number>&... x) { return elementwise(f, x...); };
  }(+f);
}

/// Gives a bound class what it does as an object of Python; nothing to any other type.
void complete_class(const py::handle& cls);

/// Errors of mgdd in place of pybind11's list of signatures, for every function and class of the module; call it last.
void make_refusals_readable(const py::module_& m);

/// Gives a function the signature that Python's own tools read.
void show_signature(PyCFunctionObject* function, const py::detail::function_record* record);

void bind_errors(py::module_& m);

}  // namespace mgdd::bindings
