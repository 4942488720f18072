// What the bindings of all seekers share: inputs from Python, ask and tell, state and history.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "keywords.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/seekers/seeker_history.hpp"
#include "mgdd/optimize/seekers/seekers.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {

/// A seeker as Python holds it.
template <class S>
using BoundSeeker = Guarded<optimize::RecordedSeeker<S>>;

template <class S>
BoundSeeker<S> bound(const char* name, S seeker) {
  return {name, optimize::RecordedSeeker<S>(std::move(seeker))};
}

/// A number (of any kind that NumPy takes) as a column of one, or a column.
inline std::vector<double> numbers_from(const py::object& value, std::string_view name) {
  const InputArray array = InputArray::ensure(value);
  if (!array) {
    PyErr_Clear();
    refuse(std::string(name), value, "one number or a sequence of numbers");
  }
  if (array.ndim() == 0) return {*array.data()};
  return to_column(array, name);
}

/// A number for every input, or one number per input.
inline optimize::Inputs inputs_from(const py::object& value, std::string_view name, Eigen::Index inputs) {
  if (py::isinstance<py::float_>(value) || py::isinstance<py::int_>(value)) {
    return optimize::Inputs::Constant(inputs, as_number(py::str(name.data(), name.size()), value));
  }
  const std::vector<double> column = numbers_from(value, name);
  if (column.size() > optimize::max_inputs) {
    throw about(name, ShapeError(std::string(name) + " has " + std::to_string(column.size()) + " entries: at most " +
                                 std::to_string(optimize::max_inputs) + " inputs are possible"));
  }
  if (column.size() == 1 && inputs > 1) return optimize::Inputs::Constant(inputs, column[0]);
  return Eigen::Map<const Eigen::VectorXd>(column.data(), static_cast<Eigen::Index>(column.size()));
}

inline optimize::SearchSpace space_from(const py::object& start, const py::object& lower, const py::object& upper) {
  optimize::SearchSpace space;
  space.start = inputs_from(start, "start", 1);
  space.lower = inputs_from(lower, "lower", space.size());
  space.upper = inputs_from(upper, "upper", space.size());
  return space;
}

inline py::array_t<double> input_array(const optimize::Inputs& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

inline std::vector<double> list_of(const optimize::Inputs& values) {
  return {values.begin(), values.end()};
}

/// The arguments `start`, `lower` and `upper` again.
inline py::dict space_dict(const optimize::SearchSpace& space) {
  py::dict out;
  out["start"] = list_of(space.start);
  out["lower"] = list_of(space.lower);
  out["upper"] = list_of(space.upper);
  return out;
}

/// Each sentence of advice becomes a UserWarning of the caller.
inline void warn_each(const std::vector<std::string>& advice) {
  for (const std::string& sentence : advice) {
    if (PyErr_WarnEx(PyExc_UserWarning, sentence.c_str(), 1) != 0) throw py::error_already_set();
  }
}

/// Numbers of a reading, kept alive as long as the spans into them.
struct ReadingBuffer {
  std::vector<double> components, limits, applied;
};

/// J as a number or one number per component; limits as a sequence in the order of the settings, or by name; what was
/// applied as a number or one number per input.
template <class S>
optimize::Reading reading_from(const S& seeker, const py::object& j, const py::object& limits, bool misfire,
                               const py::object& applied, ReadingBuffer& buffer) {
  if (j.is_none() && !misfire) throw about("J", ShapeError("J is missing: tell what was measured, or misfire=True"));
  if (!j.is_none()) {
    if (py::isinstance<py::float_>(j) || py::isinstance<py::int_>(j)) {
      buffer.components.assign(1, as_number(py::str("J"), j));
    } else {
      buffer.components = numbers_from(j, "J");
    }
  }
  if (py::isinstance<py::dict>(limits)) {
    const auto by_name = py::reinterpret_borrow<py::dict>(limits);
    if (by_name.size() > seeker.settings().limits.size()) {
      throw about("limits", ShapeError("limits has " + std::to_string(by_name.size()) + " names: the settings have " +
                                       std::to_string(seeker.settings().limits.size())));
    }
    for (const optimize::Limit& limit : seeker.settings().limits) {
      if (!by_name.contains(limit.name)) {
        throw about("limits", ShapeError("limits: '" + limit.name +
                                         "' is missing: tell one value for every limit of the settings"));
      }
      buffer.limits.push_back(as_number(py::str(limit.name), by_name[limit.name.c_str()]));
    }
  } else if (!limits.is_none()) {
    buffer.limits = numbers_from(limits, "limits");
  }
  if (!applied.is_none()) {
    buffer.applied = numbers_from(applied, "applied");
    if (buffer.applied.empty()) {
      throw about("applied", ShapeError("applied is empty: give one number per input, or leave it out"));
    }
  }
  return {buffer.components, buffer.limits, misfire, buffer.applied};
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
  double get(const Record& settings) const { return this->at(settings); }
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

/// The columns of a history; `applied` and `estimate` have one column per input, those of limits one per limit.
inline py::dict history_columns(const optimize::SeekerHistory& history) {
  py::dict out;
  const auto rows = static_cast<py::ssize_t>(history.size());
  for (const auto& [name, values] : history.save()) {
    const bool per_input = name == "applied" || name == "estimate", per_limit = name.starts_with("limit");
    const bool table = per_input || per_limit;
    const auto width = static_cast<py::ssize_t>(per_input ? history.inputs() : per_limit ? history.limits() : 1);
    out[as_str(name)] = table ? py::array_t<double>({rows, width}, values.data()) : to_array(values);
  }
  return out;
}

/// Columns of a history as Python hands them back.
inline StateColumns columns_from(const std::map<std::string, InputArray>& given) {
  StateColumns columns;
  for (const auto& [name, values] : given)
    columns[name].assign(values.data(), values.data() + values.size());
  return columns;
}

/// ask, tell, restart and what a loop asks of a recorded seeker, or of what stands around one.
template <class T>
void bind_asking(py::class_<Guarded<T>>& cls) {
  using B = Guarded<T>;
  cls.def(
         "ask", [](B& b) { return input_array(b.use()->ask()); },
         "The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.")
      .def(
          "tell",
          [](B& b, const py::object& j, const py::object& limits, bool misfire, const py::object& applied) {
            ReadingBuffer buffer;
            const optimize::Reading reading = reading_from(b.constant(), j, limits, misfire, applied, buffer);
            const auto r = b.use();
            optimize::require(r->tell(reading), r->protocol(), reading, r->component_count(), r->limit_count(),
                              r->settings().space.size());
          },
          py::arg("J") = py::none(), py::arg("limits") = py::none(), py::kw_only(), py::arg("misfire") = false,
          py::arg("applied") = py::none(),
          "Accept what was measured at the input of the last ask.\n\n"
          "J: float, or one number per component; limits: one value per limit, in order or by name;\n"
          "misfire: the cycle is counted and its J and limits are not read;\n"
          "applied: what the plant really applied, one number per input; None where it is what was asked for.\n"
          "Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond\n"
          "1e30 in magnitude); the state is unchanged then.")
      .def(
          "restart", [](B& b) { b.use()->restart(); },
          "The operating point has changed: forget the window, keep the estimate.")
      .def_property_readonly(
          "estimate", [](const B& b) { return input_array(b.use()->estimate()); },
          "Present estimate of the optimum, shape (inputs,).")
      .def_property_readonly(
          "cycle", [](const B& b) { return b.use()->protocol().cycle; }, "Cycles told so far, misfires included.")
      .def_property_readonly(
          "misfires", [](const B& b) { return b.use()->protocol().misfires; }, "Misfired cycles told so far.")
      .def_property_readonly(
          "component_count", [](const B& b) { return b.constant().component_count(); },
          "Components of J that tell takes.")
      .def_property_readonly(
          "limit_names",
          [](const B& b) {
            std::vector<std::string> names;
            for (const optimize::Limit& limit : b.constant().settings().limits)
              names.push_back(limit.name);
            return names;
          },
          "Names of the limits, in the order of tell.")
      .def_property_readonly(
          "limit_states",
          [](const B& b) {
            const auto r = b.use();
            py::dict states;
            for (std::size_t i = 0; i < r->limit_count(); ++i)
              states[as_str(r->settings().limits[i].name)] = as_str(to_string(optimize::limit_state_of(*r, i)));
            return states;
          },
          "State of every limit by name: 'free' holds nothing back, 'active' turned the last step or is broken,\n"
          "'infeasible' cannot be met together with the other limits and the bounds, as far as the learnt slopes "
          "tell;\n"
          "the estimate goes to where the largest excess, counted in scales, is smallest.");
}

/// The same with state and history, of one seeker class.
template <class S>
void bind_seeking(py::class_<BoundSeeker<S>>& cls) {
  using B = BoundSeeker<S>;
  bind_asking(cls);
  cls.def_property(
         "state", [](const B& b) { return save_state(b.use()->seeker()); },
         [](B& b, const StateColumns& columns) { b.use()->restore(columns); },
         "What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;\n"
         "a state of another kind or size raises ParameterError and changes nothing.")
      .def(
          "_history_columns", [](const B& b) { return history_columns(b.use()->history()); },
          "Columns behind .history.")
      .def(
          "_set_history_columns",
          [](B& b, const std::map<std::string, InputArray>& given) { b.use()->history().restore(columns_from(given)); },
          py::arg("columns"), "Columns behind .history, as _history_columns gave them.")
      .def("_clear_history", [](B& b) { b.use()->history().clear(); }, "Forget the history, keep the state.");
}

template <class S, class Any>
bool take_seeker(const py::handle& object, std::optional<Any>& into) {
  if (!py::isinstance<BoundSeeker<S>>(object)) return false;
  into.emplace(object.cast<const BoundSeeker<S>&>().use()->seeker());
  return true;
}
template <class Any, class... S>
bool take_any_seeker(const py::handle& object, std::optional<Any>& into, const std::variant<S...>*) {
  return (take_seeker<S>(object, into) || ...);
}

/// A copy of the seeker that Python holds, of one of the kinds of the variant; ParameterError naming the argument for
/// anything else.
template <class Any = optimize::Seeker>
Any seeker_of(const py::handle& object, const char* argument) {
  std::optional<Any> found;
  if (take_any_seeker(object, found, static_cast<const Any*>(nullptr))) return *std::move(found);
  throw about(argument, ParameterError(std::string(argument) + ": " + std::string(py::repr(object)) +
                                       " is not a seeker that runs here"));
}

/// The slope that the seeker estimates.
template <class S>
void bind_gradient(py::class_<BoundSeeker<S>>& cls) {
  cls.def_property_readonly(
      "gradient", [](const BoundSeeker<S>& b) { return input_array(b.use()->seeker().gradient()); },
      "Last estimate of the slope of the maximised objective, shape (inputs,).");
}

}  // namespace mgdd::bindings
