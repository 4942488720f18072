// Deadlines of a loop on an even grid of times in ns. A turn belongs to a grid point and has to be over before the next
// one. What is too late is skipped, so that the phase stays and turns never come in a burst. Real-time safe.
#pragma once

#include <algorithm>
#include <cstdint>

namespace mgdd::rig {

/// A turn of the loop: when it should have begun and what was missed before it.
struct Turn {
  std::int64_t number = 0;         ///< of its grid point; the numbers of skipped ones are left out
  std::int64_t deadline_ns = 0;    ///< time of its grid point
  std::int64_t woken_ns = 0;       ///< when it really began
  std::int64_t missed = 0;         ///< deadlines since the turn before: skipped grid points, and its own if it was late
  std::int64_t skipped = 0;        ///< those of them without a turn
  std::int64_t missed_in_row = 0;  ///< deadlines directly before this turn that were missed
  bool stopping = false;           ///< somebody asked for an end
};

class DeadlineGrid {
 public:
  DeadlineGrid(std::int64_t first_ns, std::int64_t period_ns) noexcept : next_ns_(first_ns), period_ns_(period_ns) {}

  /// Grid point of the turn to come.
  [[nodiscard]] std::int64_t next_ns() const noexcept { return next_ns_; }

  /// After waking: how many grid points are over by a whole period, the last one begun included. Where that is not 0
  /// the loop has to sleep again, until the new `next_ns`.
  std::int64_t skip(std::int64_t now_ns) noexcept {
    if (now_ns - next_ns_ < period_ns_) return 0;
    const std::int64_t missed = (now_ns - next_ns_) / period_ns_ + 1;
    advance(missed);
    missed_ += missed;
    in_row_ += missed;
    skipped_ += missed;
    longest_row_ = std::max(longest_row_, in_row_);
    return missed;
  }

  [[nodiscard]] Turn begin(std::int64_t now_ns) const noexcept {
    return {.number = number_,
            .deadline_ns = next_ns_,
            .woken_ns = now_ns,
            .missed = skipped_ + (late_ ? 1 : 0),
            .skipped = skipped_,
            .missed_in_row = in_row_};
  }

  /// After the turn: whether it was over in time.
  bool finish(std::int64_t now_ns) noexcept {
    const bool in_time = now_ns - next_ns_ <= period_ns_;
    advance(1);
    skipped_ = 0;
    late_ = !in_time;
    missed_ += late_ ? 1 : 0;
    in_row_ = in_time ? 0 : in_row_ + 1;
    longest_row_ = std::max(longest_row_, in_row_);
    return in_time;
  }

  [[nodiscard]] std::int64_t missed() const noexcept { return missed_; }
  [[nodiscard]] std::int64_t longest_row() const noexcept { return longest_row_; }

 private:
  void advance(std::int64_t points) noexcept {
    number_ += points;
    next_ns_ += points * period_ns_;
  }

  std::int64_t next_ns_, period_ns_;
  std::int64_t number_ = 0, missed_ = 0, in_row_ = 0, longest_row_ = 0;
  std::int64_t skipped_ = 0;  // since the last turn
  bool late_ = false;         // was the last turn
};

}  // namespace mgdd::rig
