// Watches how far a plant follows what a seeker asks, from the inputs that were really applied. Beyond a clamp, which
// is missed on one side and does not move, no estimate winds up. Where too little of the dither arrives on both sides,
// behind a lag or between the steps of a coarse actuator, the dither is stretched until it does. An offset, fine steps
// and noise of a readback leave the spread of the input as it was asked.
// Inputs in their own units. noexcept and allocation-free.
#pragma once

#include <cstdint>
#include <string>

#include "mgdd/optimize/ask_tell/seeker.hpp"

namespace mgdd::optimize {

class ClampWatch {
 public:
  explicit ClampWatch(Eigen::Index inputs) noexcept;

  /// What to ask of the plant for `wanted` around `centre`: `wanted` itself unless the dither is stretched.
  const Inputs& stretched(const Inputs& wanted, const Inputs& centre, const SearchSpace& space) noexcept;
  /// What `stretched` gave last.
  const Inputs& sent(const Inputs& wanted) const noexcept {
    return stretching_ ? sent_ : wanted;  // NOLINT(bugprone-return-const-ref-from-parameter)
  }

  /// False while the plant is on its way to `wanted`, which is to be asked again: it moves there, and has not come as
  /// far beyond `centre` as makes a measurement.
  bool arrived(const Inputs& wanted, const Inputs& applied, const Inputs& centre) noexcept {
    if (&wanted != &applied && wanted != applied) return on_the_spot(wanted, applied, centre);
    last_ = applied;
    waited_ = 0;
    return true;
  }

  /// One cycle around `centre` in which `wanted` was to be applied. Costs next to nothing as long as it is.
  void record(const Inputs& wanted, const Inputs& applied, const Inputs& centre) noexcept {
    if (watching_ || (&wanted != &applied && wanted != applied)) watch(wanted, applied, centre);
  }

  /// The end of a window in which every input was moved to both sides. `power`, where given, is the sum of
  /// (wanted - centre)^2 over it, and makes the response.
  void close_window(const Inputs& power = {}) noexcept;

  /// What turns a slope against the wanted dither into the one against the applied: 1/R with the regression
  /// R = 1 + sum (applied - wanted) (wanted - centre)/power of the last window; 0 where next to nothing arrives.
  Inputs slope_factor() const noexcept;
  /// The same for steps, which may fade with what arrives and must not grow: at most 1, with the sign of R.
  Inputs step_factor() const noexcept;
  /// `reach` of the dither, or of what arrived of it in the last window where that is more.
  Inputs reach(const Inputs& reach) const noexcept { return reach.cwiseProduct(arriving_.cwiseMax(1.0)); }

  /// The estimate, no further out than where the plant is clamped.
  Inputs keep(const Inputs& estimate) const noexcept { return estimate.cwiseMin(ceiling_).cwiseMax(floor_); }
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("clamp_watching", self.watching_);
    v("clamp_differs", self.differs_);
    v("clamp_stretching", self.stretching_);
    v("clamp_asked_low", self.asked_low_);
    v("clamp_asked_high", self.asked_high_);
    v("clamp_applied_low", self.applied_low_);
    v("clamp_applied_high", self.applied_high_);
    v("clamp_before_low", self.before_low_);
    v("clamp_before_high", self.before_high_);
    v("clamp_lost", self.lost_);
    v("clamp_ceiling", self.ceiling_);
    v("clamp_floor", self.floor_);
    v("clamp_stretch", self.stretch_);
    v("clamp_arriving", self.arriving_);
    v("clamp_response", self.response_);
    v("clamp_sent", self.sent_);
    v("clamp_last", self.last_);
    v("clamp_waited", self.waited_, counts_end);
    v("clamp_vain", self.vain_, counts_end);
    v("clamp_in_vain", self.in_vain_, counts_end);
  }

 private:
  void watch(const Inputs& wanted, const Inputs& applied, const Inputs& centre) noexcept;
  bool on_the_spot(const Inputs& wanted, const Inputs& applied, const Inputs& centre) noexcept;
  void judge(Eigen::Index i) noexcept;
  void begin_window() noexcept;

  bool watching_ = false;    // since an input was applied otherwise than asked, until it is as if that had never been
  bool differs_ = false;     // within this window
  bool stretching_ = false;  // in what was asked last
  Inputs asked_low_, asked_high_, applied_low_, applied_high_, before_low_, before_high_, lost_, ceiling_, floor_;
  Inputs stretch_, arriving_, response_, sent_;
  Inputs last_;                          // applied in the last cycle
  std::int64_t waited_ = 0;              // cycles, for the plant to arrive
  std::int64_t vain_ = 0, in_vain_ = 0;  // cycles without waiting after a wait in vain, and those to come
};

/// The slope of a rise of J between two inputs that were to lie `asked` apart and lie `distance` apart: one that rests
/// on too little of it fades with it.
double slope_between(double rise, double distance, double asked) noexcept;

/// Moves as `move_within` does, and no further out than where the plant is clamped.
inline void move_within(Inputs& estimate, const Inputs& step, const SearchSpace& space, const Inputs& reach,
                        const ClampWatch& clamp) noexcept {
  estimate = clamp.keep(estimate + step);
  move_within(estimate, Inputs::Zero(step.size()), space, reach);
}

}  // namespace mgdd::optimize
