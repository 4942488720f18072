// Parameter records of Python from the tables of common/record.hpp: keyword-only __init__, properties, `fields`,
// `to_dict`, `replace`, comparison, hash, text and pickle; and settings of what is stepped or asked.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"

namespace mgdd::bindings {

/// How Python writes a member of type T: as an `Argument`, which pybind11 converts.
template <class T>
struct Written {
  using Argument = T;

  static Argument get(const T& member) { return member; }
  static void put(T& member, Argument given, const FieldInfo&, std::size_t) { member = std::move(given); }
};
template <class Enum>
  requires std::is_enum_v<Enum>
struct Written<Enum> {
  using Argument = std::string;

  static Argument get(Enum member) { return std::string(name_of(member)); }
  static void put(Enum& member, const Argument& given, const FieldInfo& info, std::size_t) {
    member = parse_name<Enum>(info.name, given);
  }
};

/// A value of the core as Python has it.
template <class Value>
py::object as_python(const Value& value) {
  if constexpr (std::is_base_of_v<py::object, Value>) {
    return value;
  } else {
    return py::cast(value);
  }
}

/// One member of a record, without its type.
struct Member {
  FieldInfo info;
  std::string_view place;  ///< in the record, as C++ writes it
  std::string kind;        ///< as a signature names it
  py::object standard;     ///< its default as a keyword shows it
  py::object initial;      ///< ... and as `get` gives it
  bool per_input;          ///< a default of one number counts for every input
  py::object choices;      ///< names, or none
  bool number;
  std::function<py::object(const void*)> get;
  std::function<bool(void*, const py::handle&)> put;  ///< false for a value of another kind
};

/// The members of a record in the order of its table.
class Members {
 public:
  void add(Member member) { members_.push_back(std::move(member)); }

  /// How many may be given by place.
  void set_places(std::size_t places) { places_ = places; }
  /// Puts arguments into a record; false for an unknown one, one that is missing, or a value of another kind.
  bool take(void* record, const py::args& places, const py::kwargs& keywords) const;
  /// Changes a record; ParameterError that names the key and, where it is unknown, proposes another.
  void change(void* record, const char* owner, const py::dict& changes) const;
  py::dict to_dict(const void* record) const;
  /// Every member by name: unit, bounds or choices, meaning, default.
  py::dict described() const;
  /// Where every member stands in the record of the core.
  py::dict places() const;
  /// `Name(key=value)` with what differs from the defaults.
  py::str text(const char* name, const void* record) const;
  /// Gives __init__ of a class the signature and the help of its keywords.
  void show(const py::object& cls) const;

 private:
  std::vector<Member> members_;
  std::size_t places_ = 0;
};

/// How a signature names an argument of this type.
template <class Argument>
std::string kind_text() {
  const py::cpp_function probe([](const Argument&) {});
  const std::string_view text =
      py::detail::function_record_ptr_from_PyObject(PyCFunction_GET_SELF(probe.ptr()))->signature;
  const std::size_t from = text.find(": ") + 2;
  return std::string(text.substr(from, text.rfind(") -> ") - from));
}

/// Inputs of the record that have one number each, where it knows them.
template <class Record>
std::size_t inputs_in(const Record& record) {
  if constexpr (requires { record.space.size(); }) return static_cast<std::size_t>(record.space.size());
  return 1;
}

template <class Record, class T>
Member member_of(const Field<Record, T>& field, const Record& standard) {
  using W = Written<T>;
  using Argument = typename W::Argument;
  const bool none = field.info.form == DefaultForm::none;
  py::object choices = py::none();
  if constexpr (std::is_enum_v<T>) {
    py::list valid;
    for (const auto& [value, name] : names<T>())
      valid.append(as_str(name));
    choices = py::tuple(valid);
  }
  const py::object initial = as_python(W::get(field.in(standard)));
  py::object shown = none ? py::object(py::none()) : initial;
  constexpr bool per_input = requires { W::shown(field.in(standard)); };
  if constexpr (per_input) shown = W::shown(field.in(standard));
  return {
      field.info,
      field.member,
      kind_text<Argument>() + (none ? " | None" : ""),
      shown,
      initial,
      per_input,
      choices,
      std::is_arithmetic_v<T> && !std::is_same_v<T, bool>,
      [field](const void* record) { return as_python(W::get(field.in(*static_cast<const Record*>(record)))); },
      [field, none](void* record, const py::handle& value) {
        auto& owner = *static_cast<Record*>(record);
        if (none && value.is_none()) {
          field.in(owner) = field.in(Record{});
          return true;
        }
        constexpr bool left_open = requires(const T& member) { static_cast<double>(*member); };
        if ((left_open || (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>)) && py::isinstance<py::bool_>(value)) {
          refuse(std::string(field.info.name), value, "one number");  // 1.0 to pybind11
        }
        py::detail::make_caster<Argument> caster;
        if (!caster.load(value, true)) return false;
        W::put(field.in(owner), py::detail::cast_op<Argument>(std::move(caster)), field.info, inputs_in(owner));
        if constexpr (std::is_arithmetic_v<T>) {
          if (none) require_in(field.info, static_cast<double>(field.in(owner)));
        }
        return true;
      }};
}

/// The table of a record for Python, of which the first `places` may be given by place; it lives as long as the module.
template <class Record, class Table>
const Members& members_of(const Table& table, const Record& standard, std::size_t places = 0) {
  auto* members = new Members;
  members->set_places(places);
  const auto add = [&](const auto& field) { members->add(member_of(field, standard)); };
  for_each_field(table, add);
  return *members;
}

/// __init__: what `make` makes of a record filled from its arguments.
template <class Record, class Class, class Make>
void bind_keywords(Class& cls, const Members& members, Make make) {
  cls.def(py::init([&members, make](const py::args& places, const py::kwargs& keywords) {
    Record record{};
    if (!members.take(&record, places, keywords)) throw py::reference_cast_error();
    return make(std::move(record));
  }));
  members.show(cls);
}

/// A record of its own, immutable. `check` throws for what it may not be.
template <class Record, class Check>
void bind_record(py::class_<Record>& cls, const char* name, Check check, std::size_t places = 0) {
  const auto table = fields_of(Record{});
  const Members& members = members_of(table, Record{}, places);
  bind_keywords<Record>(cls, members, [check](Record made) {
    check(made);
    return made;
  });
  const auto property = [&cls]<class T>(const Field<Record, T>& field) {
    std::string doc(field.info.meaning);
    if (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) doc += " [" + std::string(field.info.unit) + "]";
    cls.def_property_readonly(
        std::string(field.info.name).c_str(), [field](const Record& self) { return Written<T>::get(field.in(self)); },
        doc.c_str());
  };
  for_each_field(table, property);
  const auto replaced = [&members, name, check](Record made, const py::dict& changes) {
    members.change(&made, name, changes);
    check(made);
    return made;
  };
  cls.def_static(
      "fields", [&members] { return members.described(); },
      "Every field by name: unit, bounds or choices, meaning, default.");
  cls.def(
      "replace", [replaced](const Record& self, const py::kwargs& changes) { return replaced(self, changes); },
      "A validated copy with some fields changed; an unknown name is a ParameterError.");
  cls.def("to_dict", [&members](const Record& self) { return members.to_dict(&self); }, "All fields as a new dict.");
  cls.def("__eq__", [](const Record& self, const py::object& other) {
    return py::isinstance<Record>(other) && self == other.cast<const Record&>();
  });
  cls.def("__hash__",
          [&members](const Record& self) { return py::hash(py::tuple(members.to_dict(&self).attr("values")())); });
  cls.def("__repr__", [&members, name](const Record& self) { return members.text(name, &self); });
  cls.def(py::pickle([&members](const Record& self) { return py::make_tuple(1, members.to_dict(&self)); },
                     [replaced](const py::tuple& state) {
                       require_pickle_version(state);
                       return replaced(Record{}, state[1].cast<py::dict>());
                     }));
}
template <class Record>
void bind_record(py::class_<Record>& cls, const char* name) {
  bind_record(cls, name, [](const Record& made) { validate(made); });
}

/// What is stepped with such settings: __init__, `fields`, `settings`, saved state, and copies that go on bit for bit.
template <class Stepped>
void bind_stepped(py::class_<Stepped>& cls, const char* name) {
  using Settings = std::remove_cvref_t<decltype(std::declval<const Stepped&>().settings())>;
  const Members& members = members_of(fields_of(Settings{}), Settings{});
  bind_keywords<Settings>(cls, members, [](const Settings& settings) { return Stepped(settings); });
  cls.def_static(
      "fields", [&members] { return members.described(); },
      "Every setting by name: unit, bounds or choices, meaning, default.");
  cls.def_static("_members", [&members] { return members.places(); }, "Member of the C++ settings by name.");
  cls.def_property_readonly(
      "settings", [&members](const Stepped& self) { return members.to_dict(&self.settings()); },
      "All settings as a new dict: keywords that make the controller again.");
  cls.def_property(
      "state", [](const Stepped& self) { return save_state(self); },
      [](Stepped& self, const StateColumns& columns) { restore_state(self, columns); },
      "What a run needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.");
  cls.def("__repr__", [&members, name](const Stepped& self) { return members.text(name, &self.settings()); });
  cls.def(py::pickle(
      [&members](const Stepped& self) {
        return py::make_tuple(1, members.to_dict(&self.settings()), save_state(self));
      },
      [](const py::tuple& saved) {
        require_pickle_version(saved);
        auto made = py::type::of<Stepped>()(**saved[1].cast<py::dict>()).template cast<Stepped>();
        restore_state(made, saved[2].cast<StateColumns>());
        return made;
      }));
}

/// The same for a controller: `step` and its duty too.
template <class Controller>
void bind_controller(py::class_<Controller>& cls, const char* name) {
  bind_stepped(cls, name);
  cls.def(
      "step", [](Controller& self, double reference, double measured) { return self.step(reference, measured); },
      py::arg("reference_deg"), py::arg("measurement_deg"),
      "Duty [-] of this sample for a reference and a measured angle [deg].\n\nNaN repeats the last value; before the "
      "first ones the duty is 0.");
  cls.def_property_readonly("duty", &Controller::duty, "Duty of the last sample [-].");
}

/// One number; ParameterError naming the key otherwise.
double as_number(const py::handle& key, const py::handle& value);

}  // namespace mgdd::bindings
