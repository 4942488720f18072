// Simultaneous perturbation stochastic approximation: the slope in every direction from two measurements, whatever the
// number of inputs (Spall 1992, gains after Spall 1998); second-order form with four measurements (Spall 2000). One
// engine cycle per measurement. All randomness is a function of (seed, iteration). ask and tell are noexcept and
// allocation-free.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker_core.hpp"
#include "mgdd/optimize/watch/first_readings.hpp"

namespace mgdd::optimize {

enum class SpsaForm { first_order, second_order };

/// decreasing: a_k = a/(k + 1 + A)^alpha, c_k = c/(k + 1)^gamma; constant: a_k = a, c_k = c, which goes on tracking.
enum class GainSchedule { decreasing, constant };

struct SpsaSettings {
  SearchSpace space;
  SpsaForm form = SpsaForm::first_order;
  GainSchedule schedule = GainSchedule::decreasing;
  /// a, squared input unit per unit of J, per input; empty: 1/|J''| by `curvature` or first readings. Second order:
  /// dimensionless, 3
  Inputs gain{};
  double stability = 50.0;               ///< A
  double gain_exponent = 0.602;          ///< alpha
  Inputs perturbation{};                 ///< c per input, in its unit, > 0; empty: 1.5 scales
  double perturbation_exponent = 0.101;  ///< gamma
  Inputs step_max{};                     ///< largest change per iteration; empty: 4/3 c
  int averaging = 1;                     ///< gradients per iteration
  bool blocking =
      false;  ///< accept a step only if J there is not below its mean around the old estimate less 2 noise_sd
  double noise_sd = 0.0;         ///< of one measurement of J, for blocking
  Inputs initial_hessian{};      ///< second order: curvature to begin with, < 0; empty: as for `gain`
  double hessian_prior = 20.0;   ///< ... and how many iterations it counts for
  double limit_amplitude = 0.5;  ///< share of c while a limit holds the estimate back
  std::uint64_t seed = 0;
  bool maximize = true;
  std::vector<Limit> limits;
  std::optional<double> curvature{};  ///< J'' if known

  std::vector<std::string> advice() const;
};
inline auto fields_of(const SpsaSettings&) {
  using S = SpsaSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::form>("form", "order of the step"),
      field<&S::schedule>("schedule", "how gain and perturbation change"),
      field<&S::gain>("gain", "of the step, per input"),
      field<&S::stability>("stability", "iterations that the first gains count for"),
      field<&S::gain_exponent>("gain_exponent", "decay of the gain"),
      field<&S::perturbation>("perturbation", "of every input"),
      field<&S::perturbation_exponent>("perturbation_exponent", "decay of the perturbation"),
      field<&S::step_max>("step_max", "largest change per iteration, per input"),
      field<&S::averaging>("averaging", "gradients per iteration"),
      field<&S::blocking>("blocking", "refuse steps that lose"),
      field<&S::noise_sd>("noise_sd", "of one measurement of J"),
      field<&S::initial_hessian>("initial_hessian", "diagonal to begin with"),
      field<&S::hessian_prior>("hessian_prior", "iterations that it counts for"),
      field<&S::limit_amplitude>("limit_amplitude", "share of the dither while a limit holds the estimate back"),
      field<&S::seed>("seed", "of the random signs"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::curvature>("curvature", "J'' where it is known"),
  };
}

class Spsa : public SeekerCore<Spsa, SpsaSettings> {
 public:
  explicit Spsa(SpsaSettings settings);

  const Inputs& ask() noexcept;
  /// New operating point: forget limits and what was measured of this iteration; keep the estimate, begin the gains
  /// anew.
  void restart() noexcept;
  /// Other random numbers from now on; a run of many seeds starts each from the same settings.
  void reseed(std::uint64_t seed) noexcept { settings_.seed = seed; }

  const Inputs& gradient() const noexcept { return gradient_; }
  const InputMatrix& hessian() const noexcept { return hessian_; }
  std::int64_t iteration() const noexcept { return iteration_; }
  /// a in use, per input; empty while the first readings are taken.
  Inputs gain() const noexcept;
  std::int64_t blocked() const noexcept { return blocked_; }
  int measurements_per_iteration() const noexcept;

  /// Moves the estimate, within the bounds; `by` is finite. A search that goes on elsewhere is restarted first.
  void shift_estimate(const Inputs& by) noexcept;

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    require_within_space("estimate", estimate_, settings_.space);
    require_within_space("candidate", candidate_, settings_.space);
    if (!(share_ > 0.0 && share_ <= 1.0)) throw ParameterError("state column 'share' must lie in (0, 1]");
    first_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    SeekerCore::visit_core(self, v);
    v("candidate", self.candidate_);
    v("gradient", self.gradient_);
    v("sum", self.sum_);
    v("hessian", self.hessian_);
    v("hessian_sum", self.hessian_sum_);
    v("missed", self.missed_);
    v("measured", self.measured_);
    v("iteration", self.iteration_, counts_end);
    v("draw", self.draw_, counts_end);
    v("stage", self.stage_, self.measurements_per_iteration());
    v("blocked", self.blocked_, counts_end);
    v("watched", self.watched_, counts_end);
    v("share", self.share_);
    v("around_j", self.around_j_);
    FirstReadings::visit(self.first_, v);
  }

 private:
  friend SeekerCore;
  bool judged_together() const noexcept { return first_.open(); }
  void begin_anew() noexcept;
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  Inputs gain_now() const noexcept;
  Inputs perturbation_now() const noexcept;
  Inputs widest() const noexcept;
  int per_gradient() const noexcept;
  double direction(int kind, Eigen::Index input) const noexcept;
  void watch(const Inputs& applied) noexcept;
  void add_slope(double rise, const Inputs& c, const Inputs& missed) noexcept;
  void finish_gradient(double j, const Inputs& applied) noexcept;
  void finish_iteration() noexcept;
  InputMatrix bent_down() noexcept;

  FirstReadings first_;
  Inputs candidate_, gradient_, sum_;
  InputMatrix hessian_, hessian_sum_;
  InputMatrix metric_;            // inverse of the bend, or squares of the perturbation
  InputMatrix missed_;            // applied less asked, per input and measurement of the gradient at work
  std::vector<double> measured_;  // of the gradient at work
  std::int64_t iteration_ = 0;    // of the gains
  std::int64_t draw_ = 0;         // gradients begun since construction: index of the random numbers
  std::int64_t stage_ = 0;        // measurement within the iteration
  std::int64_t blocked_ = 0;
  std::int64_t watched_ = 0;  // measurements in the window of the clamp watch
  double share_ = 1.0;        // perturbation now over that of the schedule
  double around_j_ = 0.0;     // sum of J measured around the estimate in this iteration
};

}  // namespace mgdd::optimize
