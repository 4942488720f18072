#include "mgdd/optimize/ask_tell/seeker_history.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

const std::vector<double>& column(const StateColumns& columns, const std::string& name, std::size_t size) {
  const auto found = columns.find(name);
  if (found == columns.end()) throw ShapeError("history has no column '" + name + "'");
  if (found->second.size() != size) {
    throw ShapeError("history column '" + name + "' has " + std::to_string(found->second.size()) +
                     " entries: must have " + std::to_string(size) +
                     ", as the others and the inputs of the seeker say");
  }
  return found->second;
}

[[noreturn]] void refuse(const std::string& name, std::size_t at, double value, const char* must) {
  throw about(name, ParameterError("history column '" + name + "', entry " + std::to_string(at) + ", holds " +
                                   text(value) + ": must be " + must));
}

}  // namespace

void SeekerHistory::make_room(std::size_t cycles) {
  const std::size_t needed = rows_.size() + cycles * width();
  if (needed > rows_.capacity()) rows_.reserve(std::max(needed, 2 * rows_.capacity()));
}

void SeekerHistory::add(std::int64_t cycle, const Inputs& applied, const Inputs& estimate, double objective,
                        bool misfire, std::span<const double> limits, std::span<const double> states) {
  make_room(1);
  rows_.insert(rows_.end(), {static_cast<double>(cycle), objective, misfire ? 1.0 : 0.0});
  rows_.insert(rows_.end(), applied.begin(), applied.end());
  rows_.insert(rows_.end(), estimate.begin(), estimate.end());
  const std::span<const double> told = limits.size() == limits_ ? limits : std::span<const double>(nothing_);
  rows_.insert(rows_.end(), told.begin(), told.end());
  if (states.size() == limits_) {
    rows_.insert(rows_.end(), states.begin(), states.end());
  } else {
    rows_.insert(rows_.end(), limits_, 0.0);
  }
}

StateColumns SeekerHistory::save() const {
  StateColumns out;
  const std::size_t n = size();
  const auto take = [&](const char* name, std::size_t from, std::size_t count) {
    std::vector<double>& values = out[name];
    values.reserve(n * count);
    for (std::size_t row = 0; row < n; ++row) {
      const auto at = rows_.begin() + static_cast<std::ptrdiff_t>(row * width() + from);
      values.insert(values.end(), at, at + static_cast<std::ptrdiff_t>(count));
    }
  };
  take("cycle", 0, 1);
  take("objective", 1, 1);
  take("misfire", 2, 1);
  take("applied", 3, inputs_);
  take("estimate", 3 + inputs_, inputs_);
  take("limits", 3 + 2 * inputs_, limits_);
  take("limit_states", 3 + 2 * inputs_ + limits_, limits_);
  return out;
}

void SeekerHistory::restore(const StateColumns& columns) {
  const auto objectives = columns.find("objective");
  const std::size_t n = objectives == columns.end() ? 0 : objectives->second.size();
  const std::vector<double>& objective = column(columns, "objective", n);
  const std::vector<double>& cycle = column(columns, "cycle", n);
  const std::vector<double>& misfire = column(columns, "misfire", n);
  const std::vector<double>& applied = column(columns, "applied", n * inputs_);
  const std::vector<double>& estimate = column(columns, "estimate", n * inputs_);
  const std::vector<double>& limits = column(columns, "limits", n * limits_);
  const std::vector<double>& states = column(columns, "limit_states", n * limits_);
  SeekerHistory next(static_cast<Eigen::Index>(inputs_), limits_);
  next.make_room(n);
  for (std::size_t row = 0; row < n; ++row) {
    if (!(cycle[row] >= 0.0 && cycle[row] <= 0x1p53 && cycle[row] == std::floor(cycle[row]))) {
      refuse("cycle", row, cycle[row], "a whole number >= 0");
    }
    const auto of_row = [&](const std::vector<double>& values) {
      return std::span<const double>(values).subspan(row * limits_, limits_);
    };
    for (const double state : of_row(states)) {
      if (state != 0.0 && state != 1.0 && state != 2.0) refuse("limit_states", row, state, "0, 1 or 2");
    }
    if (misfire[row] != 0.0 && misfire[row] != 1.0) refuse("misfire", row, misfire[row], "0 or 1");
    const auto inputs_of = [&](const std::vector<double>& values) -> Inputs {
      return Eigen::Map<const Inputs>(values.data() + row * inputs_, static_cast<Eigen::Index>(inputs_));
    };
    next.add(static_cast<std::int64_t>(cycle[row]), inputs_of(applied), inputs_of(estimate), objective[row],
             misfire[row] != 0.0, of_row(limits), of_row(states));
  }
  *this = std::move(next);
}

}  // namespace mgdd::optimize
