// Names of enumerators as a user types them, and back.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "mgdd/common/error.hpp"

namespace mgdd {

template <class Enum>
using Names = std::span<const std::pair<Enum, std::string_view>>;

template <class Enum>
std::string_view name_of(Names<Enum> names, Enum value) noexcept {
  for (const auto& [key, name] : names) {
    if (key == value) return name;
  }
  return "unknown";
}

/// The enumerator of that name; ParameterError that names the field and lists the valid names otherwise.
template <class Enum>
Enum parse_name(Names<Enum> names, std::string_view field, std::string_view given) {
  std::string valid;
  for (const auto& [key, name] : names) {
    if (name == given) return key;
    valid.append(valid.empty() ? "" : ", ").append(name);
  }
  throw ParameterError(field, given, "must be one of " + valid);
}

}  // namespace mgdd
