// One table of fields per parameter record: name, unit, domain and meaning of every member. It gives the check of the
// record, its keywords, dict, file and C++ form, its help text and the bounds of a search. A table is a range of fields
// of one type, a field, or a tuple of tables; `fields_of(const Record&)` beside the record gives its own.
#pragma once

#include <array>
#include <cstddef>
#include <ranges>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd {

/// How Python's keyword shows its default.
enum class DefaultForm {
  value,     ///< as it is
  none,      ///< None: what the record has by itself
  required,  ///< not at all: it must be given
};

struct FieldInfo {
  std::string_view name;
  std::string_view unit;  ///< "-" for none
  Domain domain;
  std::string_view meaning;
  DefaultForm form = DefaultForm::value;
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
  std::string_view member;  ///< the same way as C++ writes it: "geometry.bore_mm"

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

template <auto... Members>
inline constexpr auto written_members = [] {
  std::array<char, (spelling<Members>().size() + ...) + sizeof...(Members) - 1> letters{};
  std::size_t at = 0;
  const auto append = [&](std::string_view name) {
    if (at > 0) letters[at++] = '.';
    for (const char letter : name)
      letters[at++] = letter;
  };
  (append(spelling<Members>()), ...);
  return letters;
}();

}  // namespace detail

/// `field<&Cylinder::geometry, &GeometryParameters::bore_mm>({"bore_mm", "mm", above(0.0, 2000.0), "bore"})`.
template <auto First, auto... Rest>
constexpr auto field(const FieldInfo& info) {
  using Owner = typename detail::OwnerOf<decltype(First)>::type;
  using T = std::remove_reference_t<decltype(((std::declval<Owner&>().*First).*....*Rest))>;
  constexpr auto& letters = detail::written_members<First, Rest...>;
  return Field<Owner, T>{info, [](Owner& owner) noexcept -> T& { return ((owner.*First).*....*Rest); },
                         std::string_view(letters.data(), letters.size())};
}

/// A member that is no number with a domain: a choice, a switch, a list, a record.
template <auto First, auto... Rest>
constexpr auto field(std::string_view name, std::string_view meaning, DefaultForm form = DefaultForm::value) {
  return field<First, Rest...>(FieldInfo{name, "-", {}, meaning, form});
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

template <class Owner, class T, class Visit>
void for_each_field(const Field<Owner, T>& one, Visit& visit) {
  visit(one);
}
template <class... Tables, class Visit>
void for_each_field(const std::tuple<Tables...>& tables, Visit& visit) {
  std::apply([&](const Tables&... each) { (for_each_field(each, visit), ...); }, tables);
}
template <std::ranges::range Table, class Visit>
void for_each_field(const Table& table, Visit& visit) {
  for (const auto& each : table)
    visit(each);
}

/// ParameterError naming the first number of the table outside its domain; a number that is left open passes.
template <class Table, class Owner>
void require_fields(const Table& table, const Owner& owner) {
  const auto check = [&owner]<class T>(const Field<Owner, T>& each) {
    const T& member = each.in(owner);
    if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
      require_in(each.info, static_cast<double>(member));
    } else if constexpr (requires { static_cast<double>(*member); }) {
      if (member) require_in(each.info, static_cast<double>(*member));
    }
  };
  for_each_field(table, check);
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
