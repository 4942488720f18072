// The exception table: C++ errors become Python classes that also derive from the builtin a user would catch.
#include <exception>

#include "binding.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::bindings {
namespace {

py::object make(const char* name, const py::object& bases, const char* doc) {
  const std::string qualified = std::string("mgdd._core.") + name;
  py::object type =
      py::reinterpret_steal<py::object>(PyErr_NewExceptionWithDoc(qualified.c_str(), doc, bases.ptr(), nullptr));
  if (!type) throw py::error_already_set();
  return type;
}

// Held for the life of the process: translators outlive the module object.
struct Types {
  py::object error, parameter, shape, data, convergence, rig;
};
Types& types() {
  static Types* held = new Types;
  return *held;
}

}  // namespace

void bind_errors(py::module_& m) {
  Types& t = types();
  const py::object value_error = py::reinterpret_borrow<py::object>(PyExc_ValueError);
  const py::object runtime_error = py::reinterpret_borrow<py::object>(PyExc_RuntimeError);
  t.error = make("Error", py::reinterpret_borrow<py::object>(PyExc_Exception), "Base of everything mgdd raises.");
  t.parameter = make("ParameterError", py::make_tuple(t.error, value_error),
                     "A parameter outside its domain; the message names field, value and bound.");
  t.shape = make("ShapeError", py::make_tuple(t.error, value_error), "An array of the wrong length or dimension.");
  t.data = make("DataError", py::make_tuple(t.error, value_error),
                "Measured data that cannot be what the caller says they are.");
  t.convergence = make("ConvergenceError", py::make_tuple(t.error, runtime_error),
                       "A numerical method that did not reach its tolerance.");
  t.rig = make("RigError", py::make_tuple(t.error, py::reinterpret_borrow<py::object>(PyExc_OSError)),
               "A test rig that cannot do what was asked.");
  m.attr("Error") = t.error;
  m.attr("ParameterError") = t.parameter;
  m.attr("ShapeError") = t.shape;
  m.attr("DataError") = t.data;
  m.attr("ConvergenceError") = t.convergence;
  m.attr("RigError") = t.rig;

  py::register_exception_translator([](std::exception_ptr pointer) {
    if (!pointer) return;
    try {
      std::rethrow_exception(pointer);
    } catch (const ParameterError& e) {
      PyErr_SetString(types().parameter.ptr(), e.what());
    } catch (const ShapeError& e) {
      PyErr_SetString(types().shape.ptr(), e.what());
    } catch (const DataError& e) {
      PyErr_SetString(types().data.ptr(), e.what());
    } catch (const ConvergenceError& e) {
      PyErr_SetString(types().convergence.ptr(), e.what());
    } catch (const RigError& e) {
      PyErr_SetString(types().rig.ptr(), e.what());
    } catch (const Error& e) {
      PyErr_SetString(types().error.ptr(), e.what());
    }
  });
}

std::vector<double> to_column(const InputArray& array, std::string_view name) {
  if (array.ndim() != 1) {
    throw ShapeError(std::string(name) + " has " + std::to_string(array.ndim()) + " dimensions: must be one column");
  }
  return {array.data(), array.data() + array.size()};
}

void require_pickle_version(const py::tuple& state) {
  if (py::len(state) < 2 || !py::isinstance<py::int_>(state[0]) || state[0].cast<int>() != 1) {
    throw DataError("this pickle was written by another version of mgdd");
  }
}

py::str representation(const char* name, const py::dict& keywords) {
  py::list parts;
  for (const auto& item : keywords)
    parts.append(py::str("{}={!r}").format(item.first, item.second));
  return py::str("{}({})").format(name, py::str(", ").attr("join")(parts));
}

py::array_t<double> to_array(const std::vector<double>& column) {
  return py::array_t<double>(static_cast<py::ssize_t>(column.size()), column.data());
}

}  // namespace mgdd::bindings
