// Numbers between Python and a seeker: inputs, bounds, and what a cycle tells.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double inf = std::numeric_limits<double>::infinity();

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

/// What is applied: one number per name where inputs have names, else an array of shape (inputs,).
inline py::object asked_inputs(const optimize::Inputs& values, const std::vector<optimize::Input>& inputs) {
  if (inputs.empty()) return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
  py::dict named;
  for (std::size_t i = 0; i < inputs.size(); ++i)
    named[as_str(inputs[i].name)] = values[static_cast<Eigen::Index>(i)];
  return named;
}

inline py::array_t<double> input_array(const optimize::Inputs& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

/// The other way round; the caller has counted the entries.
inline optimize::Inputs inputs_of_array(const InputArray& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), values.size());
}

inline std::vector<double> list_of(const optimize::Inputs& values) {
  return {values.begin(), values.end()};
}
inline std::optional<std::vector<double>> list_or_none(const optimize::Inputs& values) {
  return values.size() == 0 ? std::nullopt : std::optional(list_of(values));
}

/// Numbers of a reading, kept alive as long as the spans into them.
struct ReadingBuffer {
  std::vector<double> components, limits, applied;
};

/// The numbers of a dict in the order of what they belong to, one for each of them.
template <class Named>
std::vector<double> by_name(const py::object& given, const std::vector<Named>& known, const char* argument,
                            const char* what) {
  const auto dict = py::reinterpret_borrow<py::dict>(given);
  if (dict.size() > known.size()) {
    throw about(argument, ShapeError(std::string(argument) + " has " + std::to_string(dict.size()) +
                                     " names: the settings have " + std::to_string(known.size())));
  }
  std::vector<double> out;
  for (const Named& one : known) {
    if (!dict.contains(one.name)) {
      throw about(argument, ShapeError(std::string(argument) + ": '" + one.name +
                                       "' is missing: tell one value for every " + what + " of the settings"));
    }
    out.push_back(as_number(py::str(one.name), dict[one.name.c_str()]));
  }
  return out;
}

/// J as a number or one number per component; limits as a sequence in the order of the settings, or by name; what was
/// applied as a number or one number per input, or by name.
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
    buffer.limits = by_name(limits, seeker.settings().limits, "limits", "limit");
  } else if (!limits.is_none()) {
    buffer.limits = numbers_from(limits, "limits");
  }
  if (py::isinstance<py::dict>(applied)) {
    buffer.applied = by_name(applied, seeker.settings().space.inputs, "applied", "input");
  } else if (!applied.is_none()) {
    buffer.applied = numbers_from(applied, "applied");
    if (buffer.applied.empty()) {
      throw about("applied", ShapeError("applied is empty: give one number per input, or leave it out"));
    }
  }
  return {buffer.components, buffer.limits, misfire, buffer.applied};
}

}  // namespace mgdd::bindings
