// What the bindings of all seekers share: ask and tell, state and history, and a seeker taken from Python.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker_history.hpp"
#include "mgdd/optimize/ask_tell/seekers.hpp"
#include "optimize/seeker_inputs.hpp"

namespace mgdd::bindings {

/// A seeker as Python holds it.
template <class S>
using BoundSeeker = Guarded<optimize::RecordedSeeker<S>>;

template <class S>
BoundSeeker<S> bound(const char* name, S seeker) {
  return {name, optimize::RecordedSeeker<S>(std::move(seeker))};
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

/// The delay at which every limit is read, by name [cycles].
template <class T>
py::dict limit_delays(const T& seeker) {
  py::dict delays;
  for (std::size_t i = 0; i < seeker.limit_count(); ++i)
    delays[as_str(seeker.settings().limits[i].name)] = optimize::limit_delay_of(seeker, i);
  return delays;
}

/// What `SeekerFindings` looks at, of a seeker that is in use.
template <class S>
py::dict watched(const S& seeker) {
  const auto& failures = seeker.protocol().failures;
  py::dict out;
  out["cycle"] = seeker.protocol().cycle;
  out["misfires"] = seeker.protocol().misfires;
  out["failing_above"] = input_array(failures.failing_above());
  out["failing_below"] = input_array(failures.failing_below());
  out["failing_everywhere"] = failures.failing_everywhere();
  out["limit_delays"] = limit_delays(seeker);
  out["alike"] = seeker.protocol().heard.alike();
  out["applied_share"] = input_array(seeker.protocol().heard.applied_share());
  return out;
}

/// ask, tell, restart and what a loop asks of a recorded seeker, or of what stands around one.
template <class T>
void bind_asking(py::class_<Guarded<T>>& cls) {
  using B = Guarded<T>;
  cls.def(
         "ask",
         [](B& b) {
           const auto r = b.use();
           return asked_inputs(r->ask(), b.constant().settings().space.inputs);
         },
         "The input to apply in this cycle: an array of shape (inputs,), or a dict where inputs have names. Asking "
         "again\nbefore tell gives the same.")
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
          "applied: what the plant really applied, one number per input or by name; None where it is what was asked "
          "for.\n"
          "Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond\n"
          "1e30 in magnitude); the state is unchanged then.")
      .def(
          "restart", [](B& b) { b.use()->restart(); },
          "The operating point has changed: forget the window, keep the estimate.")
      .def_property_readonly(
          "estimate", [](const B& b) { return input_array(b.use()->estimate()); },
          "Present estimate of the optimum, shape (inputs,).")
      .def_property_readonly(
          "settable",
          [](const B& b) {
            const auto r = b.use();
            return input_array(r->protocol().steps.nearest(
                r->estimate(), [&](const optimize::Inputs& at) { return optimize::excess_of(*r, at); }));
          },
          "The estimate in the steps in which its inputs are set, shape (inputs,).")
      .def_property_readonly(
          "cycle", [](const B& b) { return b.use()->protocol().cycle; }, "Cycles told so far, misfires included.")
      .def_property_readonly(
          "misfires", [](const B& b) { return b.use()->protocol().misfires; }, "Misfired cycles told so far.")
      .def_property_readonly(
          "failing_above", [](const B& b) { return input_array(b.use()->protocol().failures.failing_above()); },
          "The nearest input known to fail on the upper side, shape (inputs,); infinite: none. After four failures "
          "on\n"
          "one side (more where cycles fail by chance) no more is asked than what has worked, but for single cycles "
          "that\n"
          "try whether it still fails.")
      .def_property_readonly(
          "failing_below", [](const B& b) { return input_array(b.use()->protocol().failures.failing_below()); },
          "The same on the lower side; minus infinity: none.")
      .def_property_readonly(
          "failing_everywhere", [](const B& b) { return b.use()->protocol().failures.failing_everywhere(); },
          "True after twelve failures in a row: of several inputs, or of the start where nothing has worked yet.")
      .def_property_readonly(
          "input_names",
          [](const B& b) {
            std::vector<std::string> names;
            for (const optimize::Input& input : b.constant().settings().space.inputs)
              names.push_back(input.name);
            return names;
          },
          "Names of the inputs, in the order of the estimate; empty where they have none.")
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
          "limit_delays", [](const B& b) { return limit_delays(*b.use()); },
          "The delay at which every limit is read, by name [cycles]: as stated, until its readings clearly fit "
          "another.")
      .def_property_readonly(
          "_watched", [](const B& b) { return watched(*b.use()); }, "What the findings are made of.")
      .def_property_readonly(
          "limit_states",
          [](const B& b) {
            const auto r = b.use();
            py::dict states;
            for (std::size_t i = 0; i < r->limit_count(); ++i)
              states[as_str(r->settings().limits[i].name)] = as_str(name_of(optimize::limit_state_of(*r, i)));
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
