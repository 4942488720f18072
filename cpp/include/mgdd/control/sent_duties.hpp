// The duties that a controller has sent and that may not act yet, the last first. Part of its state; noexcept,
// heap-free.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "mgdd/common/state.hpp"
#include "mgdd/control/duty_range.hpp"
#include "mgdd/dynamics/delay_line.hpp"

namespace mgdd::control {

inline constexpr int longest_control_delay = 20;  ///< samples from a duty to its effect that a controller may know

template <class T>
using SentDuties = dynamics::DelayLine<T, longest_control_delay + 1>;

/// Puts what really left in the place of the last duty asked for; the line keeps it without the trim that is in both.
template <class T>
void correct_sent(SentDuties<T>& sent, T& asked, const DutyRange& range, T left) noexcept {
  if (!std::isfinite(left)) return;
  left = range.clamp(left);
  sent.before[0] += left - asked;
  asked = left;
}

template <class Line, class V>
void visit_sent(Line& sent, V& v) {
  static constexpr std::array<const char*, longest_control_delay + 1> names{
      "sent_0",  "sent_1",  "sent_2",  "sent_3",  "sent_4",  "sent_5",  "sent_6",
      "sent_7",  "sent_8",  "sent_9",  "sent_10", "sent_11", "sent_12", "sent_13",
      "sent_14", "sent_15", "sent_16", "sent_17", "sent_18", "sent_19", "sent_20"};
  for (std::size_t i = 0; i < names.size(); ++i)
    visit_number(v, names[i], sent.before[i]);
}

}  // namespace mgdd::control
