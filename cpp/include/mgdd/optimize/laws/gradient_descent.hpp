// Gradient descent (ascent) by two-sided differences: theta <- theta + lambda [J(theta + c) - J(theta - c)]/(2c) per
// input (Tan 2018 names lambda_c and c; Kiefer and Wolfowitz 1952 under noise). Converges on a model for
// 0 < lambda < 2/|J''|, fastest near 1/|J''|. Two cycles per input and step; ask and tell are noexcept and
// allocation-free.
#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker_core.hpp"
#include "mgdd/optimize/watch/first_readings.hpp"

namespace mgdd::optimize {

struct GradientDescentSettings {
  SearchSpace space;
  /// lambda_c, squared input unit per unit of J, per input, > 0; empty: 1/(2 |J''|) by `curvature` or first readings
  Inputs step_size{};
  Inputs difference{};           ///< c per input, in its unit, > 0; empty: its scale
  Inputs rate{};                 ///< largest change per step; empty: none, or 4 c with a step size of its own
  Inputs tolerance{};            ///< converged once every entry of a step is below it; empty: a fiftieth of the scale
  std::int64_t iterations = 60;  ///< steps after which an unconverged search says so; it goes on all the same
  bool maximize = true;
  std::vector<Limit> limits;
  std::optional<double> curvature{};  ///< J'' if known

  std::vector<std::string> advice() const;
};
inline auto fields_of(const GradientDescentSettings&) {
  using S = GradientDescentSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::step_size>("step_size", "of the step, per input"),
      field<&S::difference>("difference", "of the two measurements to the estimate, per input"),
      field<&S::rate>("rate", "largest change per step, per input"),
      field<&S::tolerance>("tolerance", "converged once every entry of a step is below, per input"),
      field<&S::iterations>("iterations", "steps after which a search that has not converged says so"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::curvature>("curvature", "J'' where it is known"),
  };
}

class GradientDescent : public SeekerCore<GradientDescent, GradientDescentSettings> {
 public:
  explicit GradientDescent(GradientDescentSettings settings);

  const Inputs& ask() noexcept;
  void restart() noexcept;

  const Inputs& gradient() const noexcept { return gradient_; }
  std::int64_t iteration() const noexcept { return iteration_; }
  /// lambda_c in use, per input; empty while the first readings are taken.
  Inputs step_size() const noexcept;
  /// The step at which the tolerance was met first, counting that step; -1 before, and after `iterations` without.
  std::int64_t converged_at() const noexcept { return converged_at_; }

  /// Moves the estimate, within the bounds; `by` is finite. A search that goes on elsewhere is restarted first.
  void shift_estimate(const Inputs& by) noexcept { move_within(estimate_, by, settings_.space, settings_.difference); }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    require_within_space("estimate", estimate_, settings_.space);
    first_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    SeekerCore::visit_core(self, v);
    v("gradient", self.gradient_);
    v("above", self.above_);
    v("above_missed", self.above_missed_);
    v("stage", self.stage_, 2 * self.estimate_.size());
    v("iteration", self.iteration_, counts_end);
    v("converged_at", self.converged_at_, std::int64_t{-1}, counts_end);
    FirstReadings::visit(self.first_, v);
  }

 private:
  friend SeekerCore;
  bool judged_together() const noexcept { return true; }
  void begin_anew() noexcept { restart(); }
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  bool move(Inputs step) noexcept;

  FirstReadings first_;
  Inputs gradient_;
  InputMatrix metric_;
  double above_ = 0.0;         // J at theta + c of the input at work
  double above_missed_ = 0.0;  // how far the plant fell short of theta + c
  std::int64_t stage_ = 0;     // measurement within the step
  std::int64_t iteration_ = 0;
  std::int64_t converged_at_ = -1;
};

}  // namespace mgdd::optimize
