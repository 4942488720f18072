// Names of enumerators as a user types them, and back: those that the code itself gives them, read from the compiler's
// spelling of each value. Enumerators count from 0 without a gap. A name that cannot be an identifier is given by
// `std::string_view other_name(Enum)` beside the enumeration, "" for the rest.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "mgdd/common/error.hpp"

namespace mgdd {

template <class Enum>
using Names = std::span<const std::pair<Enum, std::string_view>>;

namespace detail {

/// The name of an enumerator or a member; "" for a number without one, which compilers write as a cast.
template <auto value>
constexpr std::string_view spelling() noexcept {
  constexpr std::string_view key = "value = ";
  std::string_view text = __PRETTY_FUNCTION__;
  text.remove_prefix(text.find(key) + key.size());
  text = text.substr(0, text.find_first_of(";]"));
  const bool cast = text.find_first_not_of("-0123456789", text.rfind(')') + 1) == std::string_view::npos;
  return cast ? std::string_view{} : text.substr(text.rfind(':') + 1);
}

template <class Enum, std::size_t n = 0>
constexpr std::size_t count() noexcept {
  if constexpr (spelling<static_cast<Enum>(n)>().empty()) {
    return n;
  } else {
    return count<Enum, n + 1>();
  }
}

template <class Enum>
constexpr std::string_view user_name(Enum value, std::string_view spelled) noexcept {
  if constexpr (requires { other_name(value); }) {
    if (const std::string_view other = other_name(value); !other.empty()) return other;
  }
  return spelled;
}

template <class Enum>
inline constexpr auto enum_names = []<std::size_t... I>(std::index_sequence<I...>) {
  return std::array{std::pair<Enum, std::string_view>{
      static_cast<Enum>(I), user_name(static_cast<Enum>(I), spelling<static_cast<Enum>(I)>())}...};
}(std::make_index_sequence<count<Enum>()>{});

}  // namespace detail

/// Every enumerator with its name, in order.
template <class Enum>
constexpr Names<Enum> names() noexcept {
  return detail::enum_names<Enum>;
}

template <class Enum>
constexpr std::string_view name_of(Enum value) noexcept {
  const auto number = static_cast<std::size_t>(value);
  return number < names<Enum>().size() ? names<Enum>()[number].second : "unknown";
}

/// The enumerator of that name among `valid`; ParameterError that names the field and lists the valid names otherwise.
template <class Enum>
Enum parse_name(std::string_view field, std::string_view given, Names<Enum> valid = names<Enum>()) {
  std::string list;
  for (const auto& [key, name] : valid) {
    if (name == given) return key;
    list.append(list.empty() ? "" : ", ").append(name);
  }
  fail(ParameterError(field, given, "must be one of " + list));
}

/// An enumerator among the columns of a saved state (common/state.hpp): its number, refused where it names nothing.
template <class V, class Enum>
void visit_enum(V& visitor, std::string_view name, Enum& value) {
  auto number = static_cast<std::int64_t>(value);  // NOLINT(misc-const-correctness): a reader writes it
  visitor(name, number, static_cast<std::int64_t>(names<std::remove_const_t<Enum>>().size()));
  if constexpr (!std::is_const_v<Enum>) value = static_cast<Enum>(number);
}

}  // namespace mgdd
