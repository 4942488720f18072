// Calls with arguments that no signature takes. pybind11 then lists signatures; here mgdd._arguments names the argument
// that does not fit. The functions of the module get a dispatcher that looks at their error, and before at numbers that
// carry a unit: as plain numbers degrees would arrive as radians, without a word.
#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "binding.hpp"

namespace mgdd::bindings {
namespace {

using Fast = PyObject* (*)(PyObject*, PyObject* const*, Py_ssize_t, PyObject*);
using PlainCall = PyObject* (*)(PyObject*, PyObject*, PyObject*);

// pybind11 has one dispatcher for all functions; how it is called depends on its version.
Fast fast_dispatcher = nullptr;
PlainCall plain_dispatcher = nullptr;

// Setters have no name of their own: the name of the property by their function record.
std::unordered_map<PyObject*, std::string>& setter_names() {
  static auto* names = new std::unordered_map<PyObject*, std::string>;
  return *names;
}

bool is_refusal() {
  if (PyErr_ExceptionMatches(PyExc_TypeError) == 0) return false;
  py::error_already_set error;
  const bool ours = std::string_view(error.what()).find("(): incompatible ") != std::string_view::npos;
  error.restore();
  return ours;
}

bool is_plain(PyTypeObject* type) {
  return type == &PyFloat_Type || type == &PyLong_Type || type == &PyUnicode_Type || type == &PyBool_Type ||
         type == Py_TYPE(Py_None);
}

// Whether numbers of this type carry a unit, as those of pint, astropy and unyt do.
bool type_has_units(PyTypeObject* type) {
  static auto* known = new std::unordered_map<PyTypeObject*, bool>;
  const auto found = known->find(type);
  if (found != known->end()) return found->second;
  const auto has = [&](const char* name) { return py::hasattr(reinterpret_cast<PyObject*>(type), name); };
  const bool answer = has("to") && (has("dimensionality") || has("unit") || has("units"));
  Py_INCREF(type);
  return known->emplace(type, answer).first->second;
}

bool has_units(PyObject* value) {
  PyTypeObject* type = Py_TYPE(value);
  if (is_plain(type)) return false;
  if (type != &PyList_Type && type != &PyTuple_Type) return type_has_units(type);
  PyObject** items = PySequence_Fast_ITEMS(value);
  for (Py_ssize_t i = 0; i < PySequence_Fast_GET_SIZE(value); ++i) {
    if (!is_plain(Py_TYPE(items[i])) && type_has_units(Py_TYPE(items[i]))) return true;
  }
  return false;
}

// The error that says which argument does not fit, in the place of one of pybind11 where that is set; `given` are all
// arguments by place, `self` included. False, and no error, where every argument fits.
bool explain(PyObject* function, const py::list& given, const py::dict& keywords, const char* by = "refusal") {
  try {
    std::optional<py::error_already_set> original;
    if (PyErr_Occurred() != nullptr) original.emplace();
    const py::detail::function_record* record = py::detail::function_record_ptr_from_PyObject(function);
    py::list signatures;
    for (const py::detail::function_record* at = record; at != nullptr; at = at->next)
      signatures.append(py::str(at->signature));
    const bool method = record->is_method && py::len(given) > 0;
    const py::object own = method ? given[py::slice(1, std::nullopt, std::nullopt)] : py::object(given);
    const auto setter = setter_names().find(function);
    py::object name = py::str(setter != setter_names().end() ? setter->second : std::string(record->name));
    if (record->is_constructor && method) name = py::type::of(given[0]).attr("__name__");
    const py::object owner = record->is_method ? py::reinterpret_borrow<py::object>(record->scope) : py::none();
    if (record->is_method && (!method || !py::isinstance(given[0], owner))) {
      const auto text = py::str("{}() is a method of {}: call it on one").format(name, owner.attr("__name__"));
      PyErr_SetObject(PyExc_TypeError, text.ptr());
      return true;
    }
    const py::object error =
        py::module_::import("mgdd._arguments").attr(by)(name, signatures, own, keywords, record->is_method);
    if (error.is_none()) return false;
    PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
  } catch (py::error_already_set& error) {
    error.restore();
  }
  return true;
}

PyObject* call_fast(PyObject* self, PyObject* const* arguments, Py_ssize_t count, PyObject* names) {
  const Py_ssize_t places = PyVectorcall_NARGS(static_cast<std::size_t>(count));
  const Py_ssize_t named = names == nullptr ? 0 : PyTuple_GET_SIZE(names);
  const auto explained = [&](const char* by) {
    py::list given;
    for (Py_ssize_t i = 0; i < places; ++i)
      given.append(py::handle(arguments[i]));
    py::dict keywords;
    for (Py_ssize_t i = 0; i < named; ++i)
      keywords[py::handle(PyTuple_GET_ITEM(names, i))] = py::handle(arguments[places + i]);
    return explain(self, given, keywords, by);
  };
  if (std::any_of(arguments, arguments + places + named, has_units) && explained("unit_refusal")) return nullptr;
  PyObject* result = fast_dispatcher(self, arguments, count, names);
  if (result == nullptr && is_refusal()) explained("refusal");
  return result;
}

PyObject* call_plain(PyObject* self, PyObject* arguments, PyObject* named) {
  const auto explained = [&](const char* by) {
    return explain(self, py::list(py::reinterpret_borrow<py::tuple>(arguments)),
                   named == nullptr ? py::dict() : py::reinterpret_borrow<py::dict>(named), by);
  };
  bool units = has_units(arguments);
  PyObject* value = nullptr;
  for (Py_ssize_t at = 0; named != nullptr && PyDict_Next(named, &at, nullptr, &value) != 0;)
    units = units || has_units(value);
  if (units && explained("unit_refusal")) return nullptr;
  PyObject* result = plain_dispatcher(self, arguments, named);
  if (result == nullptr && is_refusal()) explained("refusal");
  return result;
}

const py::detail::function_record* record_of(PyObject* object) {
  if (!PyCFunction_Check(object) || PyCFunction_GET_SELF(object) == nullptr) return nullptr;
  return py::detail::function_record_ptr_from_PyObject(PyCFunction_GET_SELF(object));
}

void wrap(PyObject* object, const std::string& setter = "") {
  if (PyInstanceMethod_Check(object)) object = PyInstanceMethod_GET_FUNCTION(object);
  const py::detail::function_record* record = record_of(object);
  if (record == nullptr) return;
  if (!setter.empty()) setter_names()[PyCFunction_GET_SELF(object)] = setter;
  auto* function = reinterpret_cast<PyCFunctionObject*>(object);
  PyMethodDef* method = function->m_ml;
  void (*const now)() = reinterpret_cast<void (*)()>(method->ml_meth);
  const bool fast = (method->ml_flags & METH_FASTCALL) != 0;
  void (*const ours)() = fast ? reinterpret_cast<void (*)()>(&call_fast) : reinterpret_cast<void (*)()>(&call_plain);
  if (now == ours) return;
  if (fast) {
    fast_dispatcher = reinterpret_cast<Fast>(now);
  } else {
    plain_dispatcher = reinterpret_cast<PlainCall>(now);
  }
  method->ml_meth = reinterpret_cast<PyCFunction>(ours);
  show_signature(function, record);
}

void wrap_members(const py::handle& owner) {
  for (const auto& [name, member] : py::dict(owner.attr("__dict__"))) {
    if (py::isinstance<py::type>(member)) {
      if (py::hasattr(member, "__module__") && member.attr("__module__").equal(owner.attr("__name__"))) {
        complete_class(member);
        wrap_members(member);
      }
    } else if (py::isinstance<py::module_>(member)) {
      wrap_members(member);
    } else if (Py_TYPE(member.ptr()) == &PyProperty_Type) {
      wrap(member.attr("fget").ptr());
      wrap(member.attr("fset").ptr(), name.cast<std::string>());
    } else if (Py_TYPE(member.ptr()) == &PyStaticMethod_Type) {
      wrap(member.attr("__func__").ptr());
    } else {
      wrap(member.ptr());
    }
  }
}

}  // namespace

void make_refusals_readable(const py::module_& m) {
  wrap_members(m);
}

}  // namespace mgdd::bindings
