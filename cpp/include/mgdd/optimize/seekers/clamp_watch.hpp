// Watches how far a plant follows what a seeker asks. From the inputs that were really applied it learns beyond which
// one the plant does not go, so that no estimate winds up there. An offset, steps of a resolution and noise of a
// readback are not taken for a clamp: they leave the spread of the input as it was asked.
// Inputs in their own units. noexcept and allocation-free.
#pragma once

#include <string>

#include "mgdd/optimize/seekers/seeker.hpp"

namespace mgdd::optimize {

class ClampWatch {
 public:
  explicit ClampWatch(Eigen::Index inputs) noexcept;

  /// One cycle around `centre`. Costs next to nothing as long as every input is applied as asked.
  void record(const Inputs& asked, const Inputs& applied, const Inputs& centre) noexcept {
    if (watching_ || (&asked != &applied && asked != applied)) watch(asked, applied, centre);
  }

  /// The end of a window in which every input was moved to both sides: an input whose applied spread is less than 0.7
  /// of the asked one is clamped on the side where more is missing, until it is applied further out again.
  void close_window() noexcept;

  /// How much of the dither arrives, per input: 1 + sum (applied - asked) (asked - centre)/`power`, over the window
  /// under way, `power` being the sum of (asked - centre)^2 in a whole window. Exactly 1 where all was applied.
  Inputs response(const Inputs& power) const noexcept { return (lost_.cwiseQuotient(power).array() + 1.0).matrix(); }

  /// The estimate, no further out than `slack` from where the plant is clamped.
  Inputs keep(const Inputs& estimate, const Inputs& slack) const noexcept {
    return estimate.cwiseMin(ceiling_ + slack).cwiseMax(floor_ - slack);
  }
  /// True where an input was clamped in the last window.
  bool clamped() const noexcept { return clamped_; }
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("clamp_watching", self.watching_);
    v("clamp_differs", self.differs_);
    v("clamp_clamped", self.clamped_);
    v("clamp_asked_low", self.asked_low_);
    v("clamp_asked_high", self.asked_high_);
    v("clamp_applied_low", self.applied_low_);
    v("clamp_applied_high", self.applied_high_);
    v("clamp_lost", self.lost_);
    v("clamp_ceiling", self.ceiling_);
    v("clamp_floor", self.floor_);
  }

 private:
  void watch(const Inputs& asked, const Inputs& applied, const Inputs& centre) noexcept;
  void begin_window() noexcept;

  bool watching_ = false;  // since an input was applied otherwise than asked, until it is as if that had never been
  bool differs_ = false;   // within this window
  bool clamped_ = false;
  Inputs asked_low_, asked_high_, applied_low_, applied_high_, lost_, ceiling_, floor_;
};

/// Moves as `move_within` does, and no further out than `slack` from where the plant is clamped. A seeker whose dither
/// looks beyond its estimate needs no slack; another would never learn that the clamp is gone.
inline void move_within(Inputs& estimate, const Inputs& step, const SearchSpace& space, const Inputs& reach,
                        const ClampWatch& clamp, const Inputs& slack) noexcept {
  estimate = clamp.keep(estimate + step, slack);
  move_within(estimate, Inputs::Zero(step.size()), space, reach);
}

}  // namespace mgdd::optimize
