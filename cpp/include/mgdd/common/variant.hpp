// A call on whatever a variant holds, for variants that always hold one of their kinds. noexcept where the call is.
#pragma once

#include <utility>
#include <variant>

namespace mgdd {

template <class Variant, class Call>
// NOLINTNEXTLINE(bugprone-exception-escape): valueless is only a variant whose assignment threw
decltype(auto) on(Variant& held, const Call& call) noexcept {
  return std::visit(call, held);
}

/// A variant of the kinds of another and further ones.
template <class Variant, class... Further>
struct WithKindsOf;
template <class... Kinds, class... Further>
struct WithKindsOf<std::variant<Kinds...>, Further...> {
  using type = std::variant<Kinds..., Further...>;
};
template <class Variant, class... Further>
using WithKinds = typename WithKindsOf<Variant, Further...>::type;

}  // namespace mgdd
