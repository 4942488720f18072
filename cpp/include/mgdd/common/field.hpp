// What a parameter is: name, unit, domain and meaning. A table of fields stands once per record and gives its check,
// its dict and file form, its help text and the bounds of a search.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "mgdd/common/bounds.hpp"

namespace mgdd {

struct FieldInfo {
  std::string_view name;
  std::string_view unit;  ///< "-" for none
  Domain domain;
  std::string_view meaning;
};

/// ParameterError where the value lies outside the domain of its field.
inline void require_in(const FieldInfo& info, double value) {
  require_in(info.domain, info.name, value, info.unit);
}

/// A field of `Owner` and the way to its number, which may stand in a record within the owner.
template <class Owner, class T = double>
struct Field {
  FieldInfo info;
  T& (*access)(Owner&) noexcept;

  T& in(Owner& owner) const noexcept { return access(owner); }
  const T& in(const Owner& owner) const noexcept { return access(const_cast<Owner&>(owner)); }  // read only
};

namespace detail {

template <class Member>
struct OwnerOf;
template <class Owner, class T>
struct OwnerOf<T Owner::*> {
  using type = Owner;
};

}  // namespace detail

/// `field<&Cylinder::geometry, &GeometryParameters::bore_mm>({"bore_mm", "mm", above(0.0, 2000.0), "bore"})`.
template <auto First, auto... Rest>
constexpr auto field(const FieldInfo& info) {
  using Owner = typename detail::OwnerOf<decltype(First)>::type;
  using T = std::remove_reference_t<decltype(((std::declval<Owner&>().*First).*....*Rest))>;
  return Field<Owner, T>{info, [](Owner& owner) noexcept -> T& { return ((owner.*First).*....*Rest); }};
}

/// One table after the other.
template <class F, std::size_t... Sizes>
constexpr auto joined(const std::array<F, Sizes>&... tables) {
  std::array<F, (Sizes + ...)> all{};
  std::size_t at = 0;
  const auto append = [&](const auto& table) {
    for (const F& f : table)
      all[at++] = f;
  };
  (append(tables), ...);
  return all;
}

/// ParameterError naming the first field of the table outside its domain.
template <class Table, class Owner>
void require_fields(const Table& table, const Owner& owner) {
  for (const auto& f : table)
    require_in(f.info, f.in(owner));
}

/// The field of that name, or the end of the table.
template <class Table>
constexpr auto find_field(const Table& table, std::string_view name) {
  auto at = table.begin();
  while (at != table.end() && at->info.name != name)
    ++at;
  return at;
}

}  // namespace mgdd
