// The error tree: every exception of the core, mapped one to one to `mgdd.errors` in Python.
// Messages name the field, the value and the bound or the remedy; the same three stand beside the text, so that nobody
// has to read them out of it. Not for real-time paths: those return status codes.
#pragma once

#include <concepts>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>

#include "mgdd/common/text.hpp"

namespace mgdd {

/// What was given for a refused field: a number, a name, or nothing where no single field is to blame.
using ErrorValue = std::variant<std::monostate, double, std::string>;

/// A refused value and how messages show it: numbers plain, names in quotes.
struct GivenValue {
  // NOLINTBEGIN(google-explicit-constructor): call sites pass the plain value
  GivenValue(double number) : value(number), shown(text(number)) {}
  template <std::integral Int>
  GivenValue(Int number) : value(static_cast<double>(number)), shown(std::to_string(number)) {}
  template <std::convertible_to<std::string_view> Name>
  GivenValue(const Name& name) : value(std::string(std::string_view(name))) {
    shown.append("'").append(std::get<std::string>(value)).append("'");
  }
  // NOLINTEND(google-explicit-constructor)

  ErrorValue value;
  std::string shown;
};

/// Base of everything the core throws.
struct Error : std::runtime_error {
  explicit Error(const std::string& message) : std::runtime_error(message) {}
  /// `field = value unit: requirement`, for example `bore_mm = -86 mm: must be > 0`.
  Error(std::string_view refused_field, const GivenValue& given, std::string_view requirement,
        std::string_view unit = "")
      : std::runtime_error(sentence(refused_field, given, requirement, unit)),
        field(refused_field),
        value(given.value),
        bound(requirement.starts_with(must_be) ? requirement.substr(must_be.size()) : requirement) {}

  std::string field;   ///< name of the refused field; empty: none in particular
  ErrorValue value{};  ///< what was given for it
  std::string bound;   ///< what it must be, without a leading "must be ": "> 0", "in [0, 1]"

 private:
  static constexpr std::string_view must_be = "must be ";
  static std::string sentence(std::string_view refused_field, const GivenValue& given, std::string_view requirement,
                              std::string_view unit) {
    std::string message(refused_field);
    message.append(" = ").append(given.shown);
    if (!unit.empty() && unit != "-") message.append(" ").append(unit);
    return message.append(": ").append(requirement);
  }
};

/// A parameter outside its domain.
struct ParameterError : Error {
  using Error::Error;
};

/// An array of the wrong length or dimension.
struct ShapeError : Error {
  using Error::Error;
};

/// Measured data that cannot be what the caller says they are: gaps, NaN, a wrong unit.
struct DataError : Error {
  using Error::Error;
};

/// A numerical method that did not reach its tolerance where no report can carry that news.
struct ConvergenceError : Error {
  using Error::Error;
};

/// A test rig that cannot do what was asked: not connected, asked out of order, no answer.
struct RigError : Error {
  using Error::Error;
};

/// Throws; where exceptions are off, as in firmware, the program ends with the message.
template <std::derived_from<Error> E>
[[noreturn]] void fail(const E& error) {
#ifdef __cpp_exceptions
  throw error;  // NOLINT(bugprone-exception-copy-constructor-throws): a copy that fails is std::bad_alloc, as anywhere
#else
  std::fputs(error.what(), stderr);
  std::abort();
#endif
}

/// A refusal whose message has a form of its own, with the field it is about: `duty has 3 samples, angle_deg has 4`.
template <std::derived_from<Error> E>
[[nodiscard]] E about(std::string_view field, E error) {
  error.field = field;
  return error;
}

/// The same refusal with words in front of its message: `cycle 7: J = inf: must be finite`.
template <std::derived_from<Error> E>
[[nodiscard]] E in_context(std::string_view words, const E& inner) {
  E outer(std::string(words) + inner.what());
  outer.field = inner.field;
  outer.value = inner.value;
  outer.bound = inner.bound;
  return outer;
}

/// The same refusal seen from the owner of the field: `owner.field = value: ...`.
template <std::derived_from<Error> E>
[[nodiscard]] E within(std::string_view owner, const E& inner) {
  E outer = in_context(std::string(owner) + ".", inner);
  if (!inner.field.empty()) outer.field = std::string(owner) + "." + inner.field;
  return outer;
}

}  // namespace mgdd
