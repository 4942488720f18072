// What the bindings of parameter records share: description of fields, reading of one changed value, short text.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/field.hpp"

namespace mgdd::bindings {

/// Unit, bounds, meaning and default of a number.
inline py::dict describe(const FieldInfo& info, const py::object& standard) {
  py::dict record;
  record["unit"] = as_str(info.unit);
  record["lower"] = info.domain.lower;
  record["lower_open"] = info.domain.lower_open;
  record["upper"] = info.domain.upper;
  record["meaning"] = as_str(info.meaning);
  record["default"] = standard;
  return record;
}

/// Names, meaning and default of a choice.
py::dict describe_choice(std::string_view chosen, const std::vector<std::string_view>& choices,
                         std::string_view meaning);

/// `Name(key=value)` with the keywords that differ from the standard.
py::str short_representation(const char* name, const py::dict& now, const py::dict& standard);

/// One real number; ParameterError naming the key otherwise.
double as_number(const py::handle& key, const py::handle& value);

/// One name; ParameterError naming the key otherwise.
std::string as_name(const py::handle& key, const py::handle& value);

/// ParameterError that proposes the closest known name.
[[noreturn]] void unknown_field(const char* owner, const py::handle& key, const py::dict& known);

/// What parameter records share: `replace`, comparison, hashing, short text, dict, and pickle through `replaced`.
template <class Record, class ToDict, class Replaced>
void bind_parameters(py::class_<Record>& cls, const char* name, ToDict to_dict, Replaced replaced) {
  cls.def("to_dict", [to_dict](const Record& self) { return to_dict(self); }, "All fields as a new dict.");
  cls.def(
      "replace", [replaced](const Record& self, const py::kwargs& changes) { return replaced(self, changes); },
      "A validated copy with some fields changed; an unknown name is a ParameterError.");
  cls.def("__eq__", [](const Record& self, const py::object& other) {
    return py::isinstance<Record>(other) && self == other.cast<const Record&>();
  });
  cls.def("__hash__", [to_dict](const Record& self) { return py::hash(py::tuple(to_dict(self).attr("values")())); });
  cls.def("__repr__",
          [name, to_dict](const Record& self) { return short_representation(name, to_dict(self), to_dict(Record{})); });
  cls.def(py::pickle([to_dict](const Record& self) { return py::make_tuple(1, to_dict(self)); },
                     [replaced](const py::tuple& state) {
                       require_pickle_version(state);
                       return replaced(Record{}, py::kwargs(state[1].cast<py::dict>()));
                     }));
}

}  // namespace mgdd::bindings
