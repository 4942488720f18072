// The nearest step to a wished one that meets linear limits and stays in a box, by coordinate ascent on the multipliers
// (Hildreth 1957). Near is measured in the metric that made the step of the slope of J, so that a step which the limits
// turn still climbs J, and rests only where J cannot rise any more (the conditions of a constrained optimum).
// noexcept; allocation-free after construction.
#pragma once

#include <vector>

#include "mgdd/optimize/ask_tell/seeker.hpp"

namespace mgdd::optimize {

/// A slope of a limit in its scale per range of an input; one flatter than this points nowhere, and is none.
inline Inputs pointing(const Inputs& slope) noexcept {
  constexpr double least = 1e-3;
  return slope.squaredNorm() > least * least ? slope : Inputs(Inputs::Zero(slope.size()));
}

class NearestStep {
 public:
  explicit NearestStep(std::size_t limits);

  /// A new problem: the wish, the metric that made it (symmetric, positive definite) and the box of the step.
  void begin(const Inputs& wish, const InputMatrix& metric, const Inputs& lowest, const Inputs& highest) noexcept;
  /// slope . step <= room + relaxation * scale. At most as many as the constructor was told; a slope of zero is no
  /// limit.
  void add(const Inputs& slope, double room, double scale = 1.0) noexcept;

  /// Solves for the smallest relaxation up to `most` that lets a step exist; returns that relaxation.
  double solve(double most) noexcept;
  const Inputs& step() const noexcept { return step_; }
  /// What limit i pushes with: what would be gained, by the slope of J that the wish is made of, per unit of its room.
  double multiplier(std::size_t i) const noexcept { return planes_[i].multiplier; }

 private:
  struct Plane {
    Inputs slope, turned;  // turned: metric times slope
    double size = 0.0;     // slope . turned
    double room = 0.0, scale = 1.0, multiplier = 0.0;
  };
  double worst_excess(double relaxation) const noexcept;
  double least_relaxation(double most) noexcept;
  bool ascend(double relaxation, int most_passes) noexcept;

  std::vector<Plane> planes_;
  std::size_t count_ = 0;
  Inputs wish_, step_, lowest_, highest_, low_multiplier_, high_multiplier_;
  InputMatrix metric_;
};

}  // namespace mgdd::optimize
