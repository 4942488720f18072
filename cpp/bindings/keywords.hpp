// Keyword arguments from a table: one row per member of a record gives its argument of __init__, its property and its
// entry of to_dict. A row knows how Python writes the member; the default is that of the record.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

#include "binding.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::bindings {

/// A member of a member, where a row names a member.
template <class Record, class Member, class T>
struct Path {
  Member Record::* outer;
  T Member::* inner;

  T& operator()(Record& record) const { return record.*outer.*inner; }
  const T& operator()(const Record& record) const { return record.*outer.*inner; }
};
template <class Record, class Member, class T>
Path(Member Record::*, T Member::*) -> Path<Record, Member, T>;

template <class At>
struct PlaceOf;
template <class R, class T>
struct PlaceOf<T R::*> {
  using Record = R;
  using Value = T;
};
template <class R, class M, class T>
struct PlaceOf<Path<R, M, T>> {
  using Record = R;
  using Value = T;
};

/// What all rows have: the name, the place in the record, and a line of documentation.
template <class Place>
struct Row {
  using Record = typename PlaceOf<Place>::Record;
  using Value = typename PlaceOf<Place>::Value;
  const char* name;
  Place place;
  const char* doc = "";

  Value& at(Record& record) const { return std::invoke(place, record); }
  const Value& at(const Record& record) const { return std::invoke(place, record); }
};

/// A member that Python writes as it is: a number, a name, a record.
template <class Place>
struct Plain : Row<Place> {
  using typename Row<Place>::Record;
  using Argument = typename Row<Place>::Value;

  void put(Record& record, Argument value) const { this->at(record) = std::move(value); }
  Argument get(const Record& record) const { return this->at(record); }
};
template <class Place>
Plain<Place> plain(const char* name, Place place, const char* doc = "") {
  return {{name, place, doc}};
}

/// The same without a default.
template <class Place>
struct Needed : Plain<Place> {};
template <class Place>
Needed<Place> needed(const char* name, Place place, const char* doc = "") {
  return {{{name, place, doc}}};
}

/// An enumerator that Python writes by its name.
template <class Place>
struct Choice : Row<Place> {
  using typename Row<Place>::Record;
  using Argument = std::string;
  typename Row<Place>::Value (*parse)(std::string_view);

  void put(Record& record, const std::string& chosen) const { this->at(record) = parse(chosen); }
  Argument get(const Record& record) const { return std::string(to_string(this->at(record))); }
};
template <class Place>
Choice<Place> choice(const char* name, Place place, typename PlaceOf<Place>::Value (*parse)(std::string_view),
                     const char* doc = "") {
  return {{name, place, doc}, parse};
}

/// A record whose default Python writes as None.
template <class Place>
struct OrDefault : Row<Place> {
  using typename Row<Place>::Record;
  using Value = typename Row<Place>::Value;
  using Argument = std::optional<Value>;

  void put(Record& record, Argument given) const {
    if (given) this->at(record) = std::move(*given);
  }
  Value get(const Record& record) const { return this->at(record); }
};
template <class Place>
OrDefault<Place> or_default(const char* name, Place place, const char* doc = "") {
  return {{name, place, doc}};
}

/// A number that is `absent` where Python writes None.
template <class Place>
struct OrNone : Row<Place> {
  using typename Row<Place>::Record;
  using Value = typename Row<Place>::Value;
  using Argument = std::optional<Value>;
  Value absent;

  void put(Record& record, Argument given) const { this->at(record) = given.value_or(absent); }
  Argument get(const Record& record) const {
    const Value value = this->at(record);
    return value == absent || value != value ? std::nullopt : Argument(value);  // NaN is not itself
  }
};
template <class Place>
OrNone<Place> or_none(const char* name, Place place, typename PlaceOf<Place>::Value absent, const char* doc = "") {
  return {{name, place, doc}, absent};
}

/// A row as a keyword of __init__; `standard` tells the default.
template <class Each, class Record>
py::arg_v keyword(const Each& row, const Record& standard) {
  return py::arg_v(row.name, static_cast<typename Each::Argument>(row.get(standard)));
}
template <class Place>
py::arg_v keyword(const OrDefault<Place>& row, const typename PlaceOf<Place>::Record&) {
  return py::arg_v(row.name, py::none());
}

template <class Place>
py::arg keyword(const Needed<Place>& row, const typename PlaceOf<Place>::Record&) {
  return py::arg(row.name);
}

/// All rows of a record as a dict.
template <class Record, class... Rows>
py::dict dict_of(const std::tuple<Rows...>& rows, const Record& record) {
  py::dict out;
  std::apply([&](const Rows&... row) { ((out[row.name] = row.get(record)), ...); }, rows);
  return out;
}

/// Keyword-only __init__ and a property per row; `check` throws for what the record may not be.
template <class Record, class... Rows, class Check>
void bind_keywords(py::class_<Record>& cls, const std::tuple<Rows...>& rows, Check check) {
  std::apply(
      [&](const Rows&... row) {
        cls.def(py::init([rows, check](typename Rows::Argument... values) {
                  Record made;
                  std::apply([&](const Rows&... each) { (each.put(made, std::move(values)), ...); }, rows);
                  check(made);
                  return made;
                }),
                py::kw_only(), keyword(row, Record{})...);
        (cls.def_property_readonly(row.name, [row](const Record& self) { return row.get(self); }, row.doc), ...);
      },
      rows);
}

/// The same with what `bind_value` gives: for immutable records.
template <class Record, class... Rows, class Check>
void bind_rows(py::class_<Record>& cls, const char* name, const std::tuple<Rows...>& rows, Check check) {
  bind_keywords(cls, rows, check);
  bind_value(cls, name, [rows](const Record& self) { return dict_of(rows, self); });
}

}  // namespace mgdd::bindings
