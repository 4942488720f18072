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

/// Two members, least and largest applied input, as one argument: a pair; None, of it or in it, is no bound.
inline Member both_bounds(const Member& lower, Member upper) {
  Member both = upper;
  both.info.name = "bounds";
  both.info.meaning = "least and largest applied input, each a number or one per input; none without";
  both.standard = py::none();
  both.initial = py::make_tuple(lower.initial, upper.initial);
  both.get = [lower, upper](const void* record) { return py::make_tuple(lower.get(record), upper.get(record)); };
  both.put = [lower, upper](void* record, const py::handle& value) {
    const std::string pair = "a pair (lower, upper), each a number or one per input; bounds by name are inputs={...}";
    const py::object sides = value.is_none() ? py::make_tuple(value, value) : py::reinterpret_borrow<py::object>(value);
    if (!py::isinstance<py::sequence>(sides) || py::isinstance<py::str>(sides) || py::len(sides) != 2) {
      refuse("bounds", value, pair);
    }
    const py::object low = sides[py::int_(0)], high = sides[py::int_(1)];
    return lower.put(record, low.is_none() ? lower.standard : low) &&
           upper.put(record, high.is_none() ? upper.standard : high);
  };
  return both;
}

/// The table of settings for Python, where bounds are one argument; it lives as long as the module.
template <class Settings>
const Members& seeker_members() {
  auto* members = new Members;
  Member lower;
  const auto add = [&](const auto& field) {
    Member member = member_of(field, Settings{});
    if (member.info.name == "lower") {
      lower = std::move(member);
    } else {
      members->add(member.info.name == "upper" ? both_bounds(lower, std::move(member)) : std::move(member));
    }
  };
  for_each_field(fields_of(Settings{}), add);
  return *members;
}

/// Keyword-only __init__, and `settings`, which makes the seeker again.
template <class S>
void bind_settings(py::class_<BoundSeeker<S>>& cls, const char* name) {
  using Settings = std::remove_cvref_t<decltype(std::declval<const S&>().settings())>;
  const Members& members = seeker_members<Settings>();
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
