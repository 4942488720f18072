// What a seeker was told, cycle by cycle, and a seeker that keeps such a history of itself. Columns stand in the unit
// of the input and of J. Offline code: recording allocates, in blocks.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"

namespace mgdd::optimize {

class SeekerHistory {
 public:
  explicit SeekerHistory(Eigen::Index inputs, std::size_t limits = 0)
      : inputs_(static_cast<std::size_t>(inputs)), limits_(limits), nothing_(limits, std::nan("")) {}

  /// Makes the next `cycles` calls of `add` free of allocation.
  void make_room(std::size_t cycles);

  /// One told cycle: what the plant applied, the estimate before it was told, J and limits as told, NaN where the cycle
  /// misfired, and the state of each limit after it.
  void add(std::int64_t cycle, const Inputs& applied, const Inputs& estimate, double objective, bool misfire,
           std::span<const double> limits = {}, std::span<const double> states = {});
  void clear() noexcept { rows_.clear(); }

  std::size_t size() const noexcept { return rows_.size() / width(); }
  std::size_t inputs() const noexcept { return inputs_; }
  std::size_t limits() const noexcept { return limits_; }

  /// Columns `cycle`, `objective`, `misfire` (0 or 1) and, row by row, `applied`, `estimate`, `limits`
  /// and `limit_states` (numbers of LimitState).
  StateColumns save() const;
  /// The history as `save` gave it; ShapeError or ParameterError name the column, and nothing is changed then.
  void restore(const StateColumns& columns);

 private:
  std::size_t width() const noexcept { return 3 + 2 * inputs_ + 2 * limits_; }

  std::size_t inputs_, limits_;
  std::vector<double> nothing_;  // limits of a misfire
  std::vector<double> rows_;     // cycle, objective, misfire, applied, estimate, limits, states, cycle after cycle
};

/// A seeker with its history, for loops and for Python. `ask` and `tell` are those of the seeker, bit for bit.
template <class S>
class RecordedSeeker {
 public:
  explicit RecordedSeeker(S seeker)
      : seeker_(std::move(seeker)),
        history_(seeker_.estimate().size(), seeker_.limit_count()),
        states_(seeker_.limit_count(), 0.0) {}

  const Inputs& ask() noexcept { return seeker_.ask(); }
  /// Records what the seeker accepts or counts as misfired, nothing else.
  TellStatus tell(const Reading& reading) {
    history_.make_room(1);  // before the seeker learns: without memory nothing has happened
    const std::int64_t cycle = seeker_.protocol().cycle;
    const Inputs asked = seeker_.applied();  // a seeker may move both while it learns
    const Inputs estimate = seeker_.estimate();
    const TellStatus status = seeker_.tell(reading);
    if (status == TellStatus::accepted || status == TellStatus::misfire) {
      const bool misfire = status == TellStatus::misfire;
      for (std::size_t i = 0; i < states_.size(); ++i)
        states_[i] = static_cast<double>(limit_state_of(seeker_, i));
      Inputs told;
      history_.add(cycle, applied_input(reading, asked, told), estimate,
                   misfire ? std::nan("") : objective_of(reading, true), misfire,
                   misfire ? std::span<const double>() : reading.limits, states_);
    }
    return status;
  }
  void restart() noexcept { seeker_.restart(); }
  /// Of a seeker that a model guides: what the model says of a new operating point.
  template <class Guide>
  bool guide(const Guide& says) noexcept
    requires requires(S s) { s.guide(says); }
  {
    return seeker_.guide(says);
  }
  void shift_estimate(const Inputs& by) noexcept { seeker_.shift_estimate(by); }
  void restore(const StateColumns& state) { restore_state(seeker_, state); }

  const Inputs& estimate() const noexcept { return seeker_.estimate(); }
  const Inputs& applied() const noexcept { return seeker_.applied(); }
  const Protocol& protocol() const noexcept { return seeker_.protocol(); }
  std::size_t component_count() const noexcept { return seeker_.component_count(); }
  std::size_t limit_count() const noexcept { return seeker_.limit_count(); }
  LimitState limit_state(std::size_t i) const noexcept { return limit_state_of(seeker_, i); }
  double limit_delay(std::size_t i) const noexcept { return limit_delay_of(seeker_, i); }
  double excess(const Inputs& at) const noexcept { return excess_of(seeker_, at); }
  decltype(auto) settings() const noexcept { return seeker_.settings(); }
  const S& seeker() const noexcept { return seeker_; }
  SeekerHistory& history() noexcept { return history_; }
  const SeekerHistory& history() const noexcept { return history_; }

  void require_usable() const { seeker_.require_usable(); }
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    S::visit(self.seeker_, v);
  }

 private:
  S seeker_;
  SeekerHistory history_;
  std::vector<double> states_;
};

}  // namespace mgdd::optimize
