// Settings of a seeker as keywords of its class: rows of a table make __init__ and `settings`.
#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "keywords.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/optimize/seekers/dither.hpp"
#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_inputs.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {

/// Each sentence of advice becomes a UserWarning of the caller.
inline void warn_each(const std::vector<std::string>& advice) {
  for (const std::string& sentence : advice) {
    if (PyErr_WarnEx(PyExc_UserWarning, sentence.c_str(), 1) != 0) throw py::error_already_set();
  }
}

/// One number for all inputs, or one per input; the space of the settings stands already.
template <class Place>
struct PerInput : Row<Place> {
  using typename Row<Place>::Record;
  using Argument = py::object;

  void put(Record& settings, const py::object& given) const {
    this->at(settings) = inputs_from(given, this->name, settings.space.size());
  }
  std::vector<double> get(const Record& settings) const { return list_of(this->at(settings)); }
};
template <class Place>
PerInput<Place> per_input(const char* name, Place place) {
  return {{name, place}};
}
template <class Place>
py::arg_v keyword(const PerInput<Place>& row, const typename PlaceOf<Place>::Record& standard) {
  return py::arg_v(row.name, row.at(standard)[0]);
}

/// The same, empty where Python writes None.
template <class Place>
struct PerInputOrNone : PerInput<Place> {
  using typename Row<Place>::Record;

  void put(Record& settings, const py::object& given) const {
    if (!given.is_none()) PerInput<Place>::put(settings, given);
  }
  std::optional<std::vector<double>> get(const Record& settings) const { return list_or_none(this->at(settings)); }
};
template <class Place>
PerInputOrNone<Place> per_input_or_none(const char* name, Place place) {
  return {{{name, place}}};
}
template <class Place>
py::arg_v keyword(const PerInputOrNone<Place>& row, const typename PlaceOf<Place>::Record&) {
  return py::arg_v(row.name, py::none());
}

/// A number > 0; None leaves the choice to the seeker.
template <class Place>
struct PositiveOrOwn : Row<Place> {
  using typename Row<Place>::Record;
  using Argument = std::optional<double>;

  void put(Record& settings, Argument given) const {
    if (given && !(*given > 0.0)) throw ParameterError(this->name, *given, "must be > 0");
    if (given) this->at(settings) = *given;
  }
  Argument get(const Record& settings) const { return this->at(settings); }
};
template <class Place>
PositiveOrOwn<Place> positive_or_own(const char* name, Place place) {
  return {{name, place}};
}
template <class Place>
py::arg_v keyword(const PositiveOrOwn<Place>& row, const typename PlaceOf<Place>::Record&) {
  return py::arg_v(row.name, py::none());
}

/// Amplitude, period and harmonics of a dithering seeker.
template <class Settings>
auto dither_rows() {
  using Dither = optimize::DitherSettings;
  const auto place = [](auto member) { return Path{&Settings::dither, member}; };
  return std::tuple{per_input("amplitude", place(&Dither::amplitude)), plain("period", place(&Dither::period)),
                    or_default("harmonics", place(&Dither::harmonics))};
}

/// __init__ of start, bounds and the rows, all keyword-only, and `settings`, which makes the seeker again.
template <class S, class Settings, class... Rows, class Lower, class Upper>
void bind_settings(py::class_<BoundSeeker<S>>& cls, const char* name, const Settings& standard,
                   const std::tuple<Rows...>& rows, const Lower& lower, const Upper& upper) {
  const auto make = [name, rows](const py::object& start, const py::object& low, const py::object& high,
                                 typename Rows::Argument... values) {
    Settings settings;
    settings.space = space_from(start, low, high);
    std::apply([&](const Rows&... row) { (row.put(settings, std::move(values)), ...); }, rows);
    S made(std::move(settings));
    if constexpr (requires { made.settings().advice(); }) warn_each(made.settings().advice());
    return bound(name, std::move(made));
  };
  std::apply(
      [&](const Rows&... row) {
        cls.def(py::init(make), py::kw_only(), py::arg("start"), lower, upper, keyword(row, standard)...);
      },
      rows);
  cls.def_property_readonly(
      "settings",
      [rows](const BoundSeeker<S>& b) {
        const auto& settings = b.constant().seeker().settings();
        py::dict out = space_dict(settings.space);
        std::apply([&](const Rows&... row) { ((out[row.name] = row.get(settings)), ...); }, rows);
        return out;
      },
      "Arguments that make this seeker again.");
}

}  // namespace mgdd::bindings
