// What the bindings of all seekers share: inputs from Python, the recorded run, ask and tell, state and history.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/seekers/seekers.hpp"

namespace mgdd::bindings {

/// A seeker with what it was told: the history that `.history` shows.
template <class S>
struct Recorded {
  S seeker;
  std::vector<double> applied{}, estimate{}, objective{};  // one row per told cycle; estimate before the tell
  std::vector<double> misfire{}, cycle{};
};

/// A number (of any kind that NumPy takes) as a column of one, or a column.
inline std::vector<double> numbers_from(const py::object& value, std::string_view name) {
  const InputArray array(value);
  if (array.ndim() == 0) return {*array.data()};
  return to_column(array, name);
}

/// A number for every input, or one number per input.
inline optimize::Inputs inputs_from(const py::object& value, std::string_view name, Eigen::Index inputs) {
  if (py::isinstance<py::float_>(value) || py::isinstance<py::int_>(value)) {
    return optimize::Inputs::Constant(inputs, value.cast<double>());
  }
  const std::vector<double> column = numbers_from(value, name);
  if (column.size() > optimize::max_inputs) {
    throw ShapeError(std::string(name) + " has " + std::to_string(column.size()) + " entries: at most " +
                     std::to_string(optimize::max_inputs) + " inputs are possible");
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

inline py::object nan_as_none(double value) {
  return std::isnan(value) ? py::object(py::none()) : py::object(py::float_(value));
}
inline double none_as_nan(const std::optional<double>& value) {
  return value.value_or(std::numeric_limits<double>::quiet_NaN());
}

/// Each sentence of advice becomes a UserWarning of the caller.
inline void warn_each(const std::vector<std::string>& advice) {
  for (const std::string& sentence : advice) {
    if (PyErr_WarnEx(PyExc_UserWarning, sentence.c_str(), 1) != 0) throw py::error_already_set();
  }
}

/// Numbers of a reading, kept alive as long as the spans into them.
struct ReadingBuffer {
  std::vector<double> components, limits;
};

/// J as a number or one number per component; limits as a sequence in the order of the settings, or by name.
template <class S>
optimize::Reading reading_from(const S& seeker, const py::object& j, const py::object& limits, bool misfire,
                               ReadingBuffer& buffer) {
  if (j.is_none() && !misfire) throw ShapeError("J is missing: tell what was measured, or misfire=True");
  if (!j.is_none()) {
    if (py::isinstance<py::float_>(j) || py::isinstance<py::int_>(j)) {
      buffer.components.assign(1, j.cast<double>());
    } else {
      buffer.components = numbers_from(j, "J");
    }
  }
  if (py::isinstance<py::dict>(limits)) {
    const auto by_name = py::reinterpret_borrow<py::dict>(limits);
    if (by_name.size() > seeker.settings().limits.size()) {
      throw ShapeError("limits has " + std::to_string(by_name.size()) + " names: the settings have " +
                       std::to_string(seeker.settings().limits.size()));
    }
    for (const optimize::Limit& limit : seeker.settings().limits) {
      if (!by_name.contains(limit.name)) {
        throw ShapeError("limits: '" + limit.name + "' is missing: tell one value for every limit of the settings");
      }
      buffer.limits.push_back(by_name[limit.name.c_str()].template cast<double>());
    }
  } else if (!limits.is_none()) {
    buffer.limits = numbers_from(limits, "limits");
  }
  return {buffer.components, buffer.limits, misfire};
}

/// ask, tell, restart, estimate, state and history of one seeker class.
template <class S>
void bind_seeking(py::class_<Recorded<S>>& cls) {
  using R = Recorded<S>;
  cls.def(
         "ask", [](R& r) { return input_array(r.seeker.ask()); },
         "The input to apply in this cycle, shape (inputs,). Asking again before tell gives the same.")
      .def(
          "tell",
          [](R& r, const py::object& j, const py::object& limits, bool misfire) {
            ReadingBuffer buffer;
            const optimize::Reading reading = reading_from(r.seeker, j, limits, misfire, buffer);
            const optimize::Inputs before = r.seeker.estimate();
            const optimize::Inputs applied = r.seeker.applied();  // a seeker may move it while it learns
            const auto cycle = static_cast<double>(r.seeker.protocol().cycle);
            const optimize::TellStatus status = r.seeker.tell(reading);
            optimize::require(status, r.seeker.protocol(), reading, r.seeker.component_count(), r.seeker.limit_count());
            const bool fired = status == optimize::TellStatus::accepted;
            double sum = fired ? 0.0 : std::numeric_limits<double>::quiet_NaN();
            for (const double c : reading.components)
              sum += c;
            r.applied.insert(r.applied.end(), applied.data(), applied.data() + applied.size());
            r.estimate.insert(r.estimate.end(), before.data(), before.data() + before.size());
            r.objective.push_back(sum);
            r.misfire.push_back(fired ? 0.0 : 1.0);
            r.cycle.push_back(cycle);
          },
          py::arg("J") = py::none(), py::arg("limits") = py::none(), py::kw_only(), py::arg("misfire") = false,
          "Accept what was measured at the input of the last ask.\n\n"
          "J: float, or one number per component; limits: one value per limit, in order or by name;\n"
          "misfire: the cycle is counted and its numbers are not read.\n"
          "Raises ParameterError (tell without ask), ShapeError (wrong count), DataError (not finite, or beyond\n"
          "1e30 in magnitude); the state is unchanged then.")
      .def(
          "restart", [](R& r) { r.seeker.restart(); },
          "The operating point has changed: forget the window, keep the estimate.")
      .def_property_readonly(
          "estimate", [](const R& r) { return input_array(r.seeker.estimate()); },
          "Present estimate of the optimum, shape (inputs,).")
      .def_property_readonly(
          "cycle", [](const R& r) { return r.seeker.protocol().cycle; }, "Cycles told so far, misfires included.")
      .def_property_readonly(
          "misfires", [](const R& r) { return r.seeker.protocol().misfires; }, "Misfired cycles told so far.")
      .def_property_readonly(
          "component_count", [](const R& r) { return r.seeker.component_count(); }, "Components of J that tell takes.")
      .def_property_readonly(
          "limit_names",
          [](const R& r) {
            std::vector<std::string> names;
            for (const optimize::Limit& limit : r.seeker.settings().limits)
              names.push_back(limit.name);
            return names;
          },
          "Names of the limits, in the order of tell.")
      .def_property(
          "state", [](const R& r) { return save_state(r.seeker); },
          [](R& r, const StateColumns& columns) { restore_state(r.seeker, columns); },
          "What the run needs to go on bit for bit: named lists of numbers, JSON-able. Setting it restores the run;\n"
          "a state of another kind or size raises ParameterError and changes nothing.")
      .def(
          "_history_columns",
          [](const R& r) {
            py::dict out;
            const auto rows = static_cast<py::ssize_t>(r.objective.size());
            const py::ssize_t inputs = r.seeker.estimate().size();
            out["applied"] = py::array_t<double>({rows, inputs}, r.applied.data());
            out["estimate"] = py::array_t<double>({rows, inputs}, r.estimate.data());
            out["objective"] = to_array(r.objective);
            out["misfire"] = to_array(r.misfire);
            out["cycle"] = to_array(r.cycle);
            return out;
          },
          "Columns behind .history.")
      .def(
          "_set_history_columns",
          [](R& r, const InputArray& applied, const InputArray& estimate, const InputArray& objective,
             const InputArray& misfire, const InputArray& cycle) {
            const py::ssize_t rows = objective.size();
            const py::ssize_t entries = rows * r.seeker.estimate().size();
            if (applied.size() != entries || estimate.size() != entries || misfire.size() != rows ||
                cycle.size() != rows) {
              throw ShapeError("history: its columns do not belong together, or to another number of inputs");
            }
            const auto column = [](const InputArray& a) { return std::vector<double>(a.data(), a.data() + a.size()); };
            r.applied = column(applied);
            r.estimate = column(estimate);
            r.objective = column(objective);
            r.misfire = column(misfire);
            r.cycle = column(cycle);
          },
          py::kw_only(), py::arg("applied"), py::arg("estimate"), py::arg("objective"), py::arg("misfire"),
          py::arg("cycle"), "Columns behind .history, as _history_columns gave them.")
      .def(
          "_clear_history",
          [](R& r) {
            r.applied.clear();
            r.estimate.clear();
            r.objective.clear();
            r.misfire.clear();
            r.cycle.clear();
          },
          "Forget the history, keep the state.");
}

/// The slope that the seeker estimates.
template <class S>
void bind_gradient(py::class_<Recorded<S>>& cls) {
  cls.def_property_readonly(
      "gradient", [](const Recorded<S>& r) { return input_array(r.seeker.gradient()); },
      "Last estimate of the slope of the maximised objective, shape (inputs,).");
}

}  // namespace mgdd::bindings
