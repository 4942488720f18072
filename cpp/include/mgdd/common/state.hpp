// State of a running algorithm as named columns of numbers: what a run needs to go on bit for bit after a restart.
// A class lists its mutable members once, in `visit`; writing and reading walk the same list. Offline code.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd {

using StateColumns = std::map<std::string, std::vector<double>>;

/// End of a whole number that only counts: exact as a double, more than a run of centuries reaches, and far enough from
/// the ends of a word for what is added to it or multiplied with it.
inline constexpr std::int64_t counts_end = std::int64_t{1} << 48;

/// A vector or matrix of Eigen, whose headers a microcontroller does without.
template <class M>
concept DenseMatrix = requires(M& matrix) {
  typename M::PlainObject;
  { matrix.data() } -> std::convertible_to<const double*>;
  matrix.size();
};

/// Collects members into columns. Integers below 2^53 and booleans are exact as doubles, a full word as its halves.
class StateWriter {
 public:
  void operator()(std::string_view name, const double& value) { put(name, {value}); }
  void operator()(std::string_view name, const bool& value) { put(name, {value ? 1.0 : 0.0}); }
  void operator()(std::string_view name, const std::int64_t& value) = delete;  // say where it ends: StateReader
  void operator()(std::string_view name, const std::int64_t& value, std::int64_t) {
    put(name, {static_cast<double>(value)});
  }
  void operator()(std::string_view name, const std::int64_t& value, std::int64_t, std::int64_t end) {
    (*this)(name, value, end);
  }
  template <std::size_t N>
  void operator()(std::string_view name, const std::array<std::int64_t, N>& values, std::int64_t) {
    put(name, {values.begin(), values.end()});
  }
  void operator()(std::string_view name, const std::uint64_t& value) {
    put(name, {static_cast<double>(value >> 32), static_cast<double>(value & 0xFFFFFFFFu)});
  }
  /// One entry, or none.
  void operator()(std::string_view name, const std::optional<double>& value) {
    put(name, value ? std::vector<double>{*value} : std::vector<double>{});
  }
  void operator()(std::string_view name, const std::vector<double>& value) { put(name, value); }
  /// A column whose length the members visited before it tell.
  void operator()(std::string_view name, const std::vector<double>& value, std::size_t) { put(name, value); }
  template <std::size_t N>
  void operator()(std::string_view name, const std::array<double, N>& value) {
    put(name, {value.begin(), value.end()});
  }
  template <DenseMatrix M>
  void operator()(std::string_view name, const M& value) {
    put(name, std::vector<double>(value.data(), value.data() + value.size()));
  }

  StateColumns columns;

 private:
  void put(std::string_view name, std::vector<double> values) { columns[std::string(name)] = std::move(values); }
};

/// Fills members from columns; ParameterError naming the column that is missing, unknown, of the wrong length or not
/// finite.
class StateReader {
 public:
  explicit StateReader(const StateColumns& columns) : columns_(columns) {}

  void operator()(std::string_view name, double& value) { value = column(name, 1)[0]; }
  void operator()(std::string_view name, bool& value) {
    const double stored = column(name, 1)[0];
    if (stored != 0.0 && stored != 1.0) refuse(name, "holds " + text(stored) + ": must be 0 or 1");
    value = stored == 1.0;
  }
  /// A whole number counts or indexes: none is read without its end (`counts_end` for one that only counts).
  void operator()(std::string_view name, std::int64_t& value) = delete;
  /// 0 <= value < end.
  void operator()(std::string_view name, std::int64_t& value, std::int64_t end) { (*this)(name, value, 0, end); }
  /// begin <= value < end.
  void operator()(std::string_view name, std::int64_t& value, std::int64_t begin, std::int64_t end) {
    value = within(name, column(name, 1)[0], begin, end);
  }
  template <std::size_t N>
  void operator()(std::string_view name, std::array<std::int64_t, N>& values, std::int64_t end) {
    const std::vector<double>& stored = column(name, N);
    for (std::size_t i = 0; i < N; ++i)
      values[i] = within(name, stored[i], 0, end);
  }
  void operator()(std::string_view name, std::uint64_t& value) {
    const std::vector<double>& halves = column(name, 2);
    const auto half = [&](double x) { return static_cast<std::uint64_t>(whole(name, x, 0.0, 0x1p32 - 1.0)); };
    value = half(halves[0]) << 32 | half(halves[1]);
  }
  void operator()(std::string_view name, std::optional<double>& value) {
    const std::vector<double>& stored = known(name);
    if (stored.size() > 1) require_size(name, stored, 1);
    value = stored.empty() ? std::nullopt : std::optional(column(name, 1)[0]);
    if (stored.empty()) ++used_;
  }
  void operator()(std::string_view name, std::vector<double>& value) { value = column(name, value.size()); }
  void operator()(std::string_view name, std::vector<double>& value, std::size_t size) { value = column(name, size); }
  template <std::size_t N>
  void operator()(std::string_view name, std::array<double, N>& value) {
    copy(column(name, N), value.data());
  }
  template <DenseMatrix M>
  void operator()(std::string_view name, M& value) {
    copy(column(name, static_cast<std::size_t>(value.size())), value.data());
  }

  /// Call last: refuses columns that nobody asked for.
  void finish() const {
    if (used_ == columns_.size()) return;
    fail(ParameterError("state has " + std::to_string(columns_.size()) + " columns, " + std::to_string(used_) +
                        " are known here: it belongs to another kind of object, or version of mgdd"));
  }

 private:
  const std::vector<double>& known(std::string_view name) const {
    const auto found = columns_.find(std::string(name));
    if (found == columns_.end()) refuse(name, "is missing: it belongs to another kind of object, or version of mgdd");
    return found->second;
  }
  static void require_size(std::string_view name, const std::vector<double>& stored, std::size_t size) {
    if (stored.size() == size) return;
    refuse(name, "has " + std::to_string(stored.size()) + " entries: must have " + std::to_string(size) +
                     ", as these settings say");
  }
  const std::vector<double>& column(std::string_view name, std::size_t size) {
    const std::vector<double>& stored = known(name);
    require_size(name, stored, size);
    for (const double value : stored) {
      if (!std::isfinite(value)) refuse(name, "holds " + text(value) + ": must be finite");
    }
    ++used_;
    return stored;
  }
  static double whole(std::string_view name, double value, double lower, double upper) {
    if (!(value >= lower && value <= upper) || value != std::trunc(value)) {
      refuse(name, "holds " + text(value) + ": must be a whole number" + (lower < 0.0 ? "" : " >= 0"));
    }
    return value;
  }
  static std::int64_t within(std::string_view name, double value, std::int64_t begin, std::int64_t end) {
    const auto stored = static_cast<std::int64_t>(whole(name, value, -0x1p53, 0x1p53));
    if (!(stored >= begin && stored < end)) {
      refuse(name, "= " + std::to_string(stored) + ": must lie in [" + std::to_string(begin) + ", " +
                       std::to_string(end) + "), as these settings say");
    }
    return stored;
  }
  static void copy(const std::vector<double>& from, double* to) {
    for (const double value : from)
      *to++ = value;
  }
  [[noreturn]] static void refuse(std::string_view name, const std::string& why) {
    ParameterError error("state column '" + std::string(name) + "' " + why);
    error.field = name;
    fail(error);
  }

  const StateColumns& columns_;
  std::size_t used_ = 0;
};

/// Visits an object within another one: the same columns with a prefix, so that two of a kind do not meet.
template <class V>
struct Prefixed {
  V& visitor;
  std::string_view prefix;

  template <class... Values>
  void operator()(std::string_view name, Values&&... values) {
    visitor(std::string(prefix) + std::string(name), std::forward<Values>(values)...);
  }
};

/// Columns of an object whose class has `template <class Self, class V> static void visit(Self&, V&)`.
template <class T>
StateColumns save_state(const T& object) {
  StateWriter writer;
  T::visit(object, writer);
  return writer.columns;
}

/// Puts saved columns into `object`, or throws and leaves it as it was. A class that knows more about what its state
/// may be has `void require_usable() const`, which throws.
template <class T>
void restore_state(T& object, const StateColumns& columns) {
  T copy = object;
  StateReader reader(columns);
  T::visit(copy, reader);
  reader.finish();
  if constexpr (requires { copy.require_usable(); }) copy.require_usable();
  object = std::move(copy);
}

}  // namespace mgdd
