// A feed-forward whose guide was asked before the run, for loops that call no guide: what it said of every operating
// point of a schedule stands in a list. `at_cycle`, `ask` and `tell` are noexcept and allocation-free.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "mgdd/guide/feed_forward.hpp"
#include "mgdd/optimize/ask_tell/variant_seeker.hpp"

namespace mgdd::guide {

/// What goes to a feed-forward before every cycle from `first` on, up to `end`.
struct GuideAnswer {
  std::int64_t first = 0, end = 0;
  std::optional<GuideValue> value{};  ///< none: a new operating point of which the guide says nothing
  GuideCause cause = GuideCause::new_point;
};

class ScheduledFeedForward : public FeedForward<optimize::VariantSeeker> {
 public:
  explicit ScheduledFeedForward(FeedForward<optimize::VariantSeeker> begun) : FeedForward(std::move(begun)) {}

  /// Answers in the order of their cycles; they outlive the run.
  void follow(std::span<const GuideAnswer> answers) noexcept {
    answers_ = answers;
    next_ = 0;
  }
  /// The cycle that runs next; each but once, in their order.
  void at_cycle(std::int64_t cycle) noexcept {
    while (next_ < answers_.size() && answers_[next_].end <= cycle)
      ++next_;
    if (next_ == answers_.size() || answers_[next_].first > cycle) return;
    const GuideAnswer& said = answers_[next_];
    if (said.value) {
      offer(*said.value, said.cause);
    } else {
      hold();
    }
  }

 private:
  std::span<const GuideAnswer> answers_{};
  std::size_t next_ = 0;
};

}  // namespace mgdd::guide
