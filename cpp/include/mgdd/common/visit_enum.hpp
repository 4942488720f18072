// An enumerator among the columns of a saved state (common/state.hpp): its number. Offline code.
#pragma once

#include <cstdint>
#include <string_view>
#include <type_traits>

namespace mgdd {

/// ParameterError of the reader for a number that is not in [0, end).
template <class V, class Enum>
void visit_enum(V& visitor, std::string_view name, Enum& value, std::int64_t end) {
  auto number = static_cast<std::int64_t>(value);  // NOLINT(misc-const-correctness): a reader writes it
  visitor(name, number, end);
  if constexpr (!std::is_const_v<Enum>) value = static_cast<Enum>(number);
}

}  // namespace mgdd
