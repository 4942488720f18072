// Parameter records from their tables of fields: description, reading of one changed value, short text, and the class.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "keywords.hpp"
#include "mgdd/common/enum_names.hpp"
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

/// A choice of a parameter record, by name; `doc` is its meaning.
template <class Place>
struct Named : Row<Place> {
  using typename Row<Place>::Record;
  using Enum = typename Row<Place>::Value;
  using Argument = std::string;
  Names<Enum> (*names)() noexcept;

  void put(Record& record, const std::string& chosen) const {
    this->at(record) = parse_name(names(), this->name, chosen);
  }
  void read(Record& record, const py::handle& key, const py::handle& value) const { put(record, as_name(key, value)); }
  Argument get(const Record& record) const { return std::string(name_of(names(), this->at(record))); }
  py::dict described(const Record& standard) const {
    std::vector<std::string_view> valid;
    for (const auto& [value, text] : names())
      valid.push_back(text);
    return describe_choice(get(standard), valid, this->doc);
  }
};
template <class Place>
Named<Place> named(const char* name, Place place, Names<typename PlaceOf<Place>::Value> (*names)() noexcept,
                   const char* meaning) {
  return {{name, place, meaning}, names};
}

/// A number of a parameter record that may be left open.
template <class Place>
struct Open : Row<Place> {
  using typename Row<Place>::Record;
  using Argument = std::optional<double>;
  const FieldInfo* info;

  void put(Record& record, Argument given) const { this->at(record) = given; }
  void read(Record& record, const py::handle& key, const py::handle& value) const {
    put(record, value.is_none() ? Argument() : Argument(as_number(key, value)));
  }
  Argument get(const Record& record) const { return this->at(record); }
  py::dict described(const Record&) const { return describe(*info, py::none()); }
};
template <class Place>
Open<Place> open_number(const FieldInfo& info, Place place) {
  return {{info.name.data(), place, info.meaning.data()}, &info};
}

/// A record within a parameter record, with a class of its own; None is its default.
template <class Place>
struct Inner : Row<Place> {
  using typename Row<Place>::Record;
  using Value = typename Row<Place>::Value;
  using Argument = std::optional<Value>;

  void put(Record& record, Argument given) const {
    if (given) this->at(record) = std::move(*given);
  }
  void read(Record& record, const py::handle& key, const py::handle& value) const {
    if (!py::isinstance<Value>(value)) {
      refuse(py::str(key), value, "a " + py::cast<std::string>(py::type::of<Value>().attr("__name__")));
    }
    put(record, value.cast<Value>());
  }
  Value get(const Record& record) const { return this->at(record); }
  py::dict described(const Record& standard) const {
    py::dict record;
    record["unit"] = "-";
    record["meaning"] = this->doc;
    record["default"] = get(standard);
    return record;
  }
};
template <class Place>
Inner<Place> inner(const char* name, Place place, const char* meaning) {
  return {{name, place, meaning}};
}
template <class Place>
py::arg_v keyword(const Inner<Place>& row, const typename PlaceOf<Place>::Record&) {
  return py::arg_v(row.name, py::none());
}

template <std::size_t>
using Number = double;

/// A parameter record from its table of numbers and its other rows: __init__, properties, `fields`, `to_dict`,
/// `replace`, comparison, hash, short text and pickle. Checked by `validate`.
template <class Record, class Fields, class... Rows, std::size_t... I>
void bind_record(py::class_<Record>& cls, const char* name, const Fields& fields, const std::tuple<Rows...>& rows,
                 std::index_sequence<I...>) {
  const Record standard{};
  std::apply(
      [&](const Rows&... row) {
        cls.def(py::init([fields, rows](Number<I>... values, typename Rows::Argument... given) {
                  Record made;
                  ((fields[I].in(made) = values), ...);
                  std::apply([&](const Rows&... each) { (each.put(made, std::move(given)), ...); }, rows);
                  validate(made);
                  return made;
                }),
                py::kw_only(), (py::arg(fields[I].info.name.data()) = fields[I].in(standard))...,
                keyword(row, standard)...);
        (cls.def_property_readonly(row.name, [row](const Record& self) { return row.get(self); }, row.doc), ...);
      },
      rows);
  for (const auto& field : fields) {
    const std::string doc = std::string(field.info.meaning) + " [" + std::string(field.info.unit) + "]";
    cls.def_property_readonly(
        field.info.name.data(), [field](const Record& self) { return field.in(self); }, doc.c_str());
  }
  const auto to_dict = [fields, rows](const Record& self) {
    py::dict out;
    for (const auto& field : fields)
      out[as_str(field.info.name)] = field.in(self);
    std::apply([&](const Rows&... row) { ((out[row.name] = row.get(self)), ...); }, rows);
    return out;
  };
  const auto replaced = [name, fields, rows, to_dict](const Record& from, const py::dict& changes) {
    Record made = from;
    for (const auto& change : changes) {
      const py::handle key = change.first, value = change.second;
      const auto given = py::cast<std::string>(key);
      const auto field = find_field(fields, given);
      if (field != fields.end()) {
        field->in(made) = as_number(key, value);
        continue;
      }
      const auto take = [&](const auto& row) {
        if (given != row.name) return false;
        row.read(made, key, value);
        return true;
      };
      if (!std::apply([&](const Rows&... row) { return (take(row) || ...); }, rows)) {
        unknown_field(name, key, to_dict(from));
      }
    }
    validate(made);
    return made;
  };
  cls.def_static(
      "fields",
      [fields, rows] {
        const Record plain{};
        py::dict out;
        for (const auto& field : fields)
          out[as_str(field.info.name)] = describe(field.info, py::float_(field.in(plain)));
        std::apply([&](const Rows&... row) { ((out[row.name] = row.described(plain)), ...); }, rows);
        return out;
      },
      "Every field by name: unit, bounds or choices, meaning, default.");
  cls.def("to_dict", to_dict, "All fields as a new dict.");
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
                       return replaced(Record{}, state[1].cast<py::dict>());
                     }));
}

template <std::size_t n, class Record, class Fields, class... Rows>
void bind_record(py::class_<Record>& cls, const char* name, const Fields& fields, const std::tuple<Rows...>& rows) {
  bind_record(cls, name, fields, rows, std::make_index_sequence<n>{});
}

}  // namespace mgdd::bindings
