// The scale of J, from readings about the start, for a seeker whose gain the user leaves open: start, `reach` c above
// it, start, c below it, per input, six times over, each for as long as lags need and none waiting for a delay. Their
// slope, bend and scatter give the curvature to reckon with,
//   |J''| = max(share sigma/c^2, measured |J''| less 1.5 standard errors, slope/(20 c)),
// so that gains made of it lead along the same path when J is told in another unit. noexcept and allocation-free.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/laws/dither.hpp"

namespace mgdd::optimize {

class FirstReadings {
 public:
  /// Nothing is measured where J'' is known, or not `wanted`. `share` of the noise: what of |J''| c^2 to sigma is too
  /// little to be seen, and harmless to the seeker. `components`: what J comes late by.
  FirstReadings(Inputs reach, double share, bool wanted, std::optional<double> curvature = {},
                const std::vector<ComponentLag>& components = {});

  bool open() const noexcept { return open_; }
  /// The next input, about the present estimate.
  const Inputs& ask(const Inputs& estimate) noexcept;
  void learn(const Inputs& applied, double j) noexcept;
  /// A cycle without a reading: its point is asked again, or behind a delay left out.
  void skip(const Inputs& applied) noexcept;
  /// |J''| to reckon with, per input, > 0 once nothing is open and something was wanted.
  const Inputs& bend() const noexcept { return bend_; }
  /// Step per slope that takes all inputs alike, counted in reaches: `share` over J'' for the one that bends most.
  Inputs even_steps(double share) const noexcept {
    const Inputs squares = reach_.cwiseAbs2();
    return share / bend_.cwiseProduct(squares).maxCoeff() * squares;
  }
  /// The estimate has been moved: what is not closed begins anew.
  void restart() noexcept;
  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("first_open", self.open_);
    v("first_told", self.told_, 1 + self.cycles() + self.delay_);
    v("first_readings", self.readings_);
    v("first_applied", self.applied_);
    v("first_bend", self.bend_);
  }

 private:
  Eigen::Index slots() const noexcept { return 4 * reach_.size(); }  // per round: start, above, start, below each input
  std::int64_t cycles() const noexcept { return settle_ * static_cast<std::int64_t>(readings_.size()); }
  bool fill() noexcept;
  void bring_in() noexcept;
  void close() noexcept;

  Inputs reach_;
  double share_;
  std::int64_t delay_;   // cycles until the first reading of a point
  std::int64_t settle_;  // cycles for which a point is asked
  bool open_;
  std::int64_t told_ = 0;
  std::vector<double> readings_;  // round by round, slot by slot
  std::vector<double> scratch_;
  std::vector<double> applied_;  // sum of what was applied to the input of a slot
  Inputs bend_, asked_;
};

}  // namespace mgdd::optimize
