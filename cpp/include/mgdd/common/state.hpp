// State of a running algorithm as named columns of numbers: what a run needs to go on bit for bit after a restart.
// A class lists its mutable members once, in `visit`; writing and reading walk the same list. Offline code.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/common/error.hpp"

namespace mgdd {

using StateColumns = std::map<std::string, std::vector<double>>;

/// Collects members into columns. Integers below 2^53 and booleans are exact as doubles.
class StateWriter {
 public:
  void operator()(std::string_view name, const double& value) { put(name, {value}); }
  void operator()(std::string_view name, const bool& value) { put(name, {value ? 1.0 : 0.0}); }
  void operator()(std::string_view name, const std::int64_t& value) { put(name, {static_cast<double>(value)}); }
  void operator()(std::string_view name, const std::int64_t& value, std::int64_t) { (*this)(name, value); }
  void operator()(std::string_view name, const std::vector<double>& value) { put(name, value); }
  template <class Derived>
  void operator()(std::string_view name, const Eigen::PlainObjectBase<Derived>& value) {
    put(name, std::vector<double>(value.data(), value.data() + value.size()));
  }

  StateColumns columns;

 private:
  void put(std::string_view name, std::vector<double> values) { columns[std::string(name)] = std::move(values); }
};

/// Fills members from columns; ParameterError naming the column that is missing, unknown or of the wrong length.
class StateReader {
 public:
  explicit StateReader(const StateColumns& columns) : columns_(columns) {}

  void operator()(std::string_view name, double& value) { value = numbers(name, 1)[0]; }
  void operator()(std::string_view name, bool& value) { value = column(name, 1)[0] != 0.0; }
  void operator()(std::string_view name, std::int64_t& value) {
    const double stored = column(name, 1)[0];
    if (!(std::abs(stored) <= 0x1p53) || stored != std::trunc(stored)) refuse(name, "must hold a whole number");
    value = static_cast<std::int64_t>(stored);
  }
  /// A counter that indexes a table: 0 <= value < end.
  void operator()(std::string_view name, std::int64_t& value, std::int64_t end) {
    std::int64_t stored = 0;
    (*this)(name, stored);
    if (!(stored >= 0 && stored < end)) {
      refuse(name,
             "= " + std::to_string(stored) + ": must lie in [0, " + std::to_string(end) + "), as these settings say");
    }
    value = stored;
  }
  void operator()(std::string_view name, std::vector<double>& value) { value = numbers(name, value.size()); }
  template <class Derived>
  void operator()(std::string_view name, Eigen::PlainObjectBase<Derived>& value) {
    const std::vector<double>& stored = numbers(name, static_cast<std::size_t>(value.size()));
    for (Eigen::Index i = 0; i < value.size(); ++i)
      value.data()[i] = stored[static_cast<std::size_t>(i)];
  }

  /// Call last: refuses columns that nobody asked for.
  void finish() const {
    if (used_ == columns_.size()) return;
    throw ParameterError("state has " + std::to_string(columns_.size()) + " columns, " + std::to_string(used_) +
                         " are known here: it belongs to another kind of object");
  }

 private:
  const std::vector<double>& numbers(std::string_view name, std::size_t size) {
    const std::vector<double>& stored = column(name, size);
    for (const double value : stored) {
      if (std::isnan(value)) refuse(name, "holds NaN: a run would not survive it");
    }
    return stored;
  }
  const std::vector<double>& column(std::string_view name, std::size_t size) {
    const auto found = columns_.find(std::string(name));
    if (found == columns_.end()) refuse(name, "is missing: it belongs to another kind of object");
    if (found->second.size() != size) {
      refuse(name, "has " + std::to_string(found->second.size()) + " entries: must have " + std::to_string(size) +
                       ", as these settings say");
    }
    ++used_;
    return found->second;
  }
  [[noreturn]] static void refuse(std::string_view name, const std::string& why) {
    throw ParameterError("state column '" + std::string(name) + "' " + why);
  }

  const StateColumns& columns_;
  std::size_t used_ = 0;
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
