// Settings of a seeker as keywords of its class, from the table of its record.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_inputs.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {

/// One number for all inputs, or one per input; empty where Python writes None.
template <>
struct Written<optimize::Inputs> {
  using Argument = py::object;

  static py::object get(const optimize::Inputs& values) {
    return values.size() == 0 ? py::object(py::none()) : py::cast(list_of(values));
  }
  static py::object shown(const optimize::Inputs& values) {
    return values.size() == 1 ? py::object(py::float_(values[0])) : get(values);
  }
  static void put(optimize::Inputs& values, const py::object& given, const FieldInfo& info, std::size_t inputs) {
    values.resize(0);
    if (!given.is_none()) values = inputs_from(given, info.name, static_cast<Eigen::Index>(inputs));
  }
};

/// Surfaces, None for those that are not there.
template <>
struct Written<std::vector<optimize::Surface>> {
  using Argument = std::vector<std::optional<optimize::Surface>>;

  static py::object get(const std::vector<optimize::Surface>& surfaces) {
    py::list out;
    for (const optimize::Surface& one : surfaces)
      out.append(one.empty() ? py::object(py::none()) : py::cast(one));
    return surfaces.empty() ? py::object(py::none()) : py::object(out);
  }
  static void put(std::vector<optimize::Surface>& surfaces, Argument given, const FieldInfo&, std::size_t) {
    surfaces.clear();
    for (auto& one : given)
      surfaces.push_back(one ? std::move(*one) : optimize::Surface{});
  }
};

/// Each sentence of advice becomes a UserWarning of the caller.
inline void warn_each(const std::vector<std::string>& advice) {
  for (const std::string& sentence : advice) {
    if (PyErr_WarnEx(PyExc_UserWarning, sentence.c_str(), 1) != 0) throw py::error_already_set();
  }
}

/// Keyword-only __init__, and `settings`, which makes the seeker again.
template <class S>
void bind_settings(py::class_<BoundSeeker<S>>& cls, const char* name) {
  using Settings = std::remove_cvref_t<decltype(std::declval<const S&>().settings())>;
  const Members& members = members_of(fields_of(Settings{}), Settings{});
  bind_keywords<Settings>(cls, members, [name](Settings settings) {
    S made(std::move(settings));
    if constexpr (requires { made.settings().advice(); }) warn_each(made.settings().advice());
    return bound(name, std::move(made));
  });
  cls.def_property_readonly(
      "settings", [&members](const BoundSeeker<S>& b) { return members.to_dict(&b.constant().seeker().settings()); },
      "Arguments that make this seeker again.");
}

}  // namespace mgdd::bindings
