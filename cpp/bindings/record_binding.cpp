#include "record_binding.hpp"

#include "mgdd/common/error.hpp"

namespace mgdd::bindings {

py::dict describe_choice(std::string_view chosen, const std::vector<std::string_view>& choices,
                         std::string_view meaning) {
  py::dict record;
  record["unit"] = "-";
  py::list names;
  for (const std::string_view name : choices)
    names.append(as_str(name));
  record["choices"] = py::tuple(names);
  record["meaning"] = as_str(meaning);
  record["default"] = as_str(chosen);
  return record;
}

py::str short_representation(const char* name, const py::dict& now, const py::dict& standard) {
  py::list parts;
  for (const auto& item : now) {
    if (!item.second.equal(standard[item.first])) {
      parts.append(py::str("{}={!r}").format(item.first, item.second));
    }
  }
  return py::str("{}({})").format(name, py::str(", ").attr("join")(parts));
}

std::string as_name(const py::handle& key, const py::handle& value) {
  if (!py::isinstance<py::str>(value)) refuse(std::string(py::str(key)), value, "a name");
  return value.cast<std::string>();
}

double as_number(const py::handle& key, const py::handle& value) {
  if (py::isinstance<py::bool_>(value) || py::isinstance<py::str>(value)) {
    refuse(std::string(py::str(key)), value, "one number");
  }
  const py::object number = py::reinterpret_steal<py::object>(PyNumber_Float(value.ptr()));
  if (!number) {
    PyErr_Clear();
    refuse(std::string(py::str(key)), value, "one number");
  }
  return number.cast<double>();
}

void unknown_field(const char* owner, const py::handle& key, const py::dict& known) {
  const py::object close = py::module_::import("difflib").attr("get_close_matches")(key, known.attr("keys")(), 1);
  std::string hint = "one of " + std::string(py::str(py::str(", ").attr("join")(known.attr("keys")())));
  if (py::len(close) > 0) hint = "did you mean '" + close[py::int_(0)].cast<std::string>() + "'?";
  throw about(owner, ParameterError(std::string(owner) + " has no field '" + std::string(py::str(key)) + "': " + hint));
}

}  // namespace mgdd::bindings
