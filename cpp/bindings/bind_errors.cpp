// The exception table: C++ errors become the classes of mgdd.errors.
#include <exception>

#include "binding.hpp"
#include "guarded.hpp"
#include "interruptible.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::bindings {
namespace {

// Held for the life of the process: translators outlive the module object.
const py::object& errors() {
  static const auto* held = new py::object(py::module_::import("mgdd.errors"));
  return *held;
}

void raise(const char* name, const Error& error) {
  const py::object type = errors().attr(name);
  const py::object field = error.field.empty() ? py::object(py::none()) : py::str(error.field);
  const py::object bound = error.bound.empty() ? py::object(py::none()) : py::str(error.bound);
  const py::object made =
      type(py::str(error.what()), py::arg("field") = field, py::arg("value") = error.value, py::arg("bound") = bound);
  PyErr_SetObject(type.ptr(), made.ptr());
}

}  // namespace

void bind_errors(py::module_&) {
  static_cast<void>(errors());
  py::register_local_exception_translator([](std::exception_ptr pointer) {
    if (!pointer) return;
    try {
      std::rethrow_exception(pointer);
    } catch (const ParameterError& e) {
      raise("ParameterError", e);
    } catch (const ShapeError& e) {
      raise("ShapeError", e);
    } catch (const DataError& e) {
      raise("DataError", e);
    } catch (const ConvergenceError& e) {
      raise("ConvergenceError", e);
    } catch (const RigError& e) {
      raise("RigError", e);
    } catch (const Error& e) {
      raise("Error", e);
    } catch (const InUse& e) {
      raise("InUseError", Error(e.what()));
    }
  });
}

std::optional<py::error_already_set> raised_by_a_signal() {
  if (PyErr_CheckSignals() == 0) return std::nullopt;
  return py::error_already_set();
}

void refuse(const std::string& name, const py::handle& value, const std::string& bound) {
  const py::object type = errors().attr("ParameterError");
  const py::str message =
      py::str("{} = {}: must be {}").format(name, py::module_::import("mgdd._arguments").attr("shown")(value), bound);
  const py::object made = type(message, py::arg("field") = name, py::arg("value") = value, py::arg("bound") = bound);
  PyErr_SetObject(type.ptr(), made.ptr());
  throw py::error_already_set();
}

void raise_interrupted(const std::string& kept, const py::object& partial) {
  const py::object type = errors().attr("Interrupted");
  PyErr_SetObject(type.ptr(), type(kept, partial).ptr());
  throw py::error_already_set();
}

std::vector<double> to_column(const InputArray& array, std::string_view name) {
  if (array.ndim() != 1) {
    throw about(name, ShapeError(std::string(name) + " has " + std::to_string(array.ndim()) +
                                 " dimensions: must be one column"));
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
