// What is stepped with settings from a table of fields: keyword-only __init__, `fields`, `settings`, saved state, and
// copies that go on bit for bit; of a controller `step` and its duty too.
#pragma once

#include <cstddef>
#include <tuple>
#include <utility>

#include "binding.hpp"
#include "mgdd/common/state.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {

/// A whole number, a list of them or a switch among the settings of a controller.
template <class Place>
struct Explained : Plain<Place> {
  py::dict described(const typename Row<Place>::Record& standard) const {
    py::dict record;
    record["meaning"] = this->doc;
    record["default"] = this->get(standard);
    return record;
  }
};
template <class Place>
Explained<Place> explained(const char* name, Place place, const char* meaning) {
  return {{{name, place, meaning}}};
}

template <class Controller, class Settings, class Fields, class... Rows, std::size_t... I>
void bind_stepped(py::class_<Controller>& cls, const char* name, const Settings& standard, const Fields& fields,
                  const std::tuple<Rows...>& rows, std::index_sequence<I...>) {
  std::apply(
      [&](const Rows&... row) {
        cls.def(py::init([fields, rows](Number<I>... values, typename Rows::Argument... given) {
                  Settings settings;
                  ((fields[I].in(settings) = values), ...);
                  std::apply([&](const Rows&... each) { (each.put(settings, std::move(given)), ...); }, rows);
                  return Controller(settings);
                }),
                py::kw_only(), (py::arg(fields[I].info.name.data()) = fields[I].in(standard))...,
                keyword(row, standard)...);
      },
      rows);
  const auto to_dict = [fields, rows](const Settings& settings) {
    py::dict out;
    for (const auto& field : fields)
      out[as_str(field.info.name)] = field.in(settings);
    std::apply([&](const Rows&... row) { ((out[row.name] = row.get(settings)), ...); }, rows);
    return out;
  };
  cls.def_static(
      "fields",
      [fields, rows, standard] {
        py::dict out;
        for (const auto& field : fields)
          out[as_str(field.info.name)] = describe(field.info, py::float_(field.in(standard)));
        std::apply([&](const Rows&... row) { ((out[row.name] = row.described(standard)), ...); }, rows);
        return out;
      },
      "Every setting by name: unit, bounds or choices, meaning, default.");
  cls.def_property_readonly(
      "settings", [to_dict](const Controller& self) { return to_dict(self.settings()); },
      "All settings as a new dict: keywords that make the controller again.");
  cls.def_property(
      "state", [](const Controller& self) { return save_state(self); },
      [](Controller& self, const StateColumns& columns) { restore_state(self, columns); },
      "What a run needs to go on bit for bit; a state that the settings do not allow is refused and changes nothing.");
  cls.def("__repr__", [name, to_dict, standard](const Controller& self) {
    return short_representation(name, to_dict(self.settings()), to_dict(standard));
  });
  cls.def(py::pickle(
      [to_dict](const Controller& self) { return py::make_tuple(1, to_dict(self.settings()), save_state(self)); },
      [](const py::tuple& saved) {
        require_pickle_version(saved);
        auto made = py::type::of<Controller>()(**saved[1].cast<py::dict>()).template cast<Controller>();
        restore_state(made, saved[2].cast<StateColumns>());
        return made;
      }));
}

template <class Controller, class Settings, class Fields, class... Rows, std::size_t... I>
void bind_controller(py::class_<Controller>& cls, const char* name, const Settings& standard, const Fields& fields,
                     const std::tuple<Rows...>& rows, std::index_sequence<I...> numbers) {
  bind_stepped(cls, name, standard, fields, rows, numbers);
  cls.def(
      "step", [](Controller& self, double reference, double measured) { return self.step(reference, measured); },
      py::arg("reference_deg"), py::arg("measurement_deg"),
      "Duty [-] of this sample for a reference and a measured angle [deg].\n\nNaN repeats the last value; before the "
      "first ones the duty is 0.");
  cls.def_property_readonly("duty", &Controller::duty, "Duty of the last sample [-].");
}

}  // namespace mgdd::bindings
