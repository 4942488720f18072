// Limits of the inputs of a horizon and the set of those that act: bounds of each input and of its change from the one
// before. Acting limits of changes tie neighbours into runs; a run with a bound, or tied to the input that acted last,
// is fixed, any other moves as one. noexcept; double or float; heap-free where N is known to the compiler.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "mgdd/control/horizon_line.hpp"

namespace mgdd::control {

/// What the input of a stage follows: its law, a value, or the input before it.
enum class StageKind : std::uint8_t { free, fixed, tied };

template <class T, int N>
class HorizonSet {
 public:
  using Inputs = Along<T, N>;
  using Signs = Along<std::int8_t, N>;

  std::size_t size() const noexcept { return tie_.size(); }
  /// Of a horizon whose length is told at run time: nothing acts.
  void resize(std::size_t length) {
    for (Signs* signs : {&tie_, &bound_})
      stretch(*signs, length);
    for (Flags* flags : {&wrong_tie_, &wrong_bound_, &ground_})
      stretch(*flags, length);
    stretch(first_, length);
    stretch(kind_, length);
    stretch(next_kind_, length);
    stretch(value_, length);
    clear();
  }

  /// Bounds of an input and of its change; 1e30 and above for none.
  void limit(T lower, T upper, T largest_change) noexcept {
    lower_ = lower;
    upper_ = upper;
    largest_change_ = largest_change;
    const T size_of = std::max(std::abs(lower), std::abs(upper));
    slack_ = T(64) * std::numeric_limits<T>::epsilon() * (size_of < T(1e29) ? size_of : T(1));
  }

  void clear() noexcept {
    std::ranges::fill(tie_, std::int8_t{0});
    std::ranges::fill(bound_, std::int8_t{0});
  }
  /// What acts one sample later.
  void shift() noexcept {
    std::copy(tie_.begin() + 1, tie_.end(), tie_.begin());
    std::copy(bound_.begin() + 1, bound_.end(), bound_.begin());
    tie_.back() = 0;
  }

  T lowest(T before) const noexcept { return std::max(lower_, before - largest_change_); }
  T highest(T before) const noexcept { return std::min(upper_, before + largest_change_); }
  /// The nearest inputs in the order of time that keep the limits.
  void clamp(Inputs& input, T before) const noexcept {
    for (T& u : input)
      before = u = std::clamp(u, lowest(before), highest(before));
  }
  bool contains(const Inputs& input, T before) const noexcept {
    for (const T u : input) {
      if (!(u >= lowest(before) - slack_ && u <= highest(before) + slack_)) return false;
      before = u;
    }
    return true;
  }

  StageKind kind(std::size_t k) const noexcept { return kind_[k]; }
  /// Deviation from the nominal input of a fixed stage, or of a tied one from that of the stage before.
  T value(std::size_t k) const noexcept { return value_[k]; }

  /// Kinds and values from what acts; of limits that follow from others of their run the first stays. Lowers
  /// `valid_from` to behind the last stage whose kind changed.
  void arrange(const Inputs& nominal, T before, int& valid_from) noexcept {
    auto& kind = next_kind_;
    std::ranges::fill(kind, StageKind::free);
    bool grounded = false;
    std::size_t first = 0;
    T above_first(0);
    for (std::size_t k = 0; k < size(); ++k) {
      if (tie_[k] != 0) {
        kind[k] = StageKind::tied;
        const T change = T(tie_[k]) * largest_change_;
        value_[k] = change - (nominal[k] - (k == 0 ? before : nominal[k - 1]));
        above_first += change;
        if (k == 0) grounded = true;
      } else {
        first = k;
        grounded = false;
        above_first = T(0);
      }
      first_[k] = static_cast<std::int32_t>(first);
      ground_[k] = bound_[k] != 0 && !grounded;
      if (ground_[k]) {
        grounded = true;
        kind[first] = StageKind::fixed;
        value_[first] = (bound_[k] > 0 ? upper_ : lower_) - above_first - nominal[first];
      } else {
        bound_[k] = 0;
      }
    }
    for (std::size_t k = 0; k < size(); ++k) {
      if (kind[k] != kind_[k]) valid_from = std::max(valid_from, static_cast<int>(k) + 1);
    }
    std::swap(kind_, next_kind_);
  }

  /// Marks limits whose multiplier has the wrong sign, all of them or the worst, by the slopes of the stage costs.
  /// True if there is none.
  bool judge(const Inputs& slope, T tolerance, bool all) noexcept {
    std::fill(wrong_tie_.begin(), wrong_tie_.end(), false);
    std::fill(wrong_bound_.begin(), wrong_bound_.end(), false);
    Flags* worst_in = nullptr;
    std::size_t worst_at = 0;
    T worst = tolerance;
    const auto weigh = [&](Flags& marks, std::size_t k, T pull) {
      if (!(pull > tolerance)) return;
      if (all) marks[k] = true;
      if (pull > worst) {
        worst = pull;
        worst_in = &marks;
        worst_at = k;
      }
    };
    T carried(0);  // slope that a bound later in the run takes up
    for (std::size_t k = size(); k-- > 0;) {
      const std::size_t first = static_cast<std::size_t>(first_[k]);
      if (ground_[k]) {
        carried = slope[first];
        weigh(wrong_bound_, k, T(bound_[k]) * carried);
      }
      if (tie_[k] != 0) {
        weigh(wrong_tie_, k, T(tie_[k]) * (slope[k] - carried));
      } else {
        carried = T(0);
      }
    }
    if (worst_in != nullptr) (*worst_in)[worst_at] = true;
    return worst_in == nullptr;
  }
  void drop_wrong() noexcept {
    for (std::size_t k = 0; k < size(); ++k) {
      if (wrong_tie_[k]) tie_[k] = 0;
      if (wrong_bound_[k]) bound_[k] = 0;
    }
  }

  /// A wanted input confined to its limits; what confines it acts from now on, and what acted goes on where it still
  /// does and was not marked wrong.
  T confine(std::size_t k, T wanted, T before) noexcept {
    const T low = lowest(before), high = highest(before);
    const T u = std::clamp(wanted, low, high);
    if (wanted > high + slack_ || wanted < low - slack_) {
      const bool up = wanted > high;
      const bool by_bound = u == (up ? upper_ : lower_);
      const std::int8_t sign = up ? 1 : -1;
      bound_[k] = by_bound ? sign : std::int8_t{0};
      tie_[k] = by_bound ? std::int8_t{0} : sign;
      return u;
    }
    const auto at = [&](T limit) { return std::abs(u - limit) <= slack_; };
    if (wrong_tie_[k] || !at(before + T(tie_[k]) * largest_change_)) tie_[k] = 0;
    if (wrong_bound_[k] || !at(bound_[k] > 0 ? upper_ : lower_)) bound_[k] = 0;
    return u;
  }

  /// Goes from feasible inputs towards a target until a limit stops the way; that limit acts from now on.
  void advance(Inputs& input, const Inputs& target, T before) noexcept {
    T share(1);
    std::int8_t* stop = nullptr;
    std::int8_t sign = 0;
    T last_step(0), last = before;
    const auto meet = [&](T step, T u, T low, T high, std::int8_t& acting) {
      if (acting != 0 || !(std::abs(step) > slack_)) return;
      const T room = ((step > T(0) ? high : low) - u) / step;
      if (room < share) {
        share = std::max(room, T(0));
        stop = &acting;
        sign = step > T(0) ? 1 : -1;
      }
    };
    for (std::size_t k = 0; k < size(); ++k) {
      const T step = target[k] - input[k];
      meet(step, input[k], lower_, upper_, bound_[k]);
      meet(step - last_step, input[k] - last, -largest_change_, largest_change_, tie_[k]);
      last_step = step;
      last = input[k];
    }
    for (std::size_t k = 0; k < size(); ++k)
      input[k] += share * (target[k] - input[k]);
    if (stop != nullptr) *stop = sign;
    clamp(input, before);
  }

  Signs& ties() noexcept { return tie_; }
  Signs& bounds() noexcept { return bound_; }
  const Signs& ties() const noexcept { return tie_; }
  const Signs& bounds() const noexcept { return bound_; }

 private:
  using Flags = Along<bool, N>;

  T lower_{-1}, upper_{1}, largest_change_{T(1e30)};
  T slack_{0};             // what rounding may do to an input
  Signs tie_{}, bound_{};  // which limit acts: the upper (1), the lower (-1) or none
  Flags wrong_tie_{}, wrong_bound_{}, ground_{};
  Along<std::int32_t, N> first_{};  // of the run
  Along<StageKind, N> kind_{}, next_kind_{};
  Inputs value_{};
};

}  // namespace mgdd::control
