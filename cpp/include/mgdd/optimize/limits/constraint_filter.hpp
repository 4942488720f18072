// Measured limits inside a seeker: learns how each limited quantity answers the input, from the cycles that the seeker
// runs anyway, and rejects steps predicted to violate a limit, the dither of the set-point included.
// Methods for the objective: none ("switching": the filter alone, the gradient of a violated limit replaces that of J),
// quadratic penalty, or logarithmic barrier. noexcept and allocation-free after construction.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/belief/local_model.hpp"
#include "mgdd/optimize/limits/nearest_step.hpp"
#include "mgdd/optimize/watch/causing_inputs.hpp"

namespace mgdd::optimize {

enum class LimitMethod { switching, penalty, barrier };

/// free: holds nothing back; active: turned the last step, or is broken; infeasible: cannot be met together with the
/// others and the bounds, as far as the learnt slopes tell.
enum class LimitState { free, active, infeasible };

/// value <= upper - margin, measured once per cycle. Excess is counted in units of `scale`.
struct Limit {
  std::string name;
  double upper = 0.0;
  double margin = 0.0;  ///< kept free below `upper`, same unit, >= 0
  LimitMethod method = LimitMethod::switching;
  double weight = 1.0;        ///< penalty: J units per squared scaled excess; barrier: J units times the logarithm
  double scale = 0.0;         ///< > 0; 0 = abs(upper), or 1
  ComponentLag lag{};         ///< between the input and the reading: a reading is judged on the input that caused it
  double margin_sd = 1.0;     ///< added to `margin`: standard deviations of the reading about its local model, >= 0
  int delay_uncertainty = 3;  ///< [cycles] the delay may be off by as many to either side, 0 to 20: readings decide

  bool operator==(const Limit&) const = default;
};
constexpr auto fields_of(const Limit&) {
  using L = Limit;
  return std::tuple{
      field<&L::name>("name", "what is limited", DefaultForm::required),
      field<&L::upper>("upper", "the limit", DefaultForm::required),
      field<&L::margin>("margin", "kept free below the limit"),
      field<&L::method>("method", "how J knows of the limit"),
      field<&L::weight>("weight", "of penalty or barrier"),
      field<&L::scale>("scale", "unit of the excess; 0: the limit itself"),
      field<&L::lag, &ComponentLag::delay_cycles>("delay_cycles", "transport delay of the reading"),
      field<&L::lag, &ComponentLag::lag_cycles>("lag_cycles", "time constant of its lag"),
      field<&L::margin_sd>("margin_sd", "margin in standard deviations of the reading"),
      field<&L::delay_uncertainty>("delay_uncertainty", "cycles that the delay may be off to either side"),
  };
}
void validate(const std::vector<Limit>& limits);
/// Their lags, for planes that look back `memory` cycles, and longer behind a lag, where a slope takes longer to show.
/// Refuses a limit's own mistakes before its lag sizes anything.
std::vector<UncertainLag> lags_of(const std::vector<Limit>& limits, double memory);
/// What is kept free for a limit of which more readings lie above than its margin lets expect; integral action, >= 0.
/// `scatter` is the standard deviation of a reading, `memory` the cycles in which a limit that is always broken adds
/// one.
void learn_excess(double& extra, const Limit& limit, double reading, double scatter, double memory) noexcept;

/// How a seeker steps, for the length of one call.
struct StepFrame {
  const SearchSpace& space;
  const Inputs& margin;       ///< room that the estimate keeps to the bounds
  const Inputs& reach;        ///< of the dither to both sides, now
  const Inputs& rate;         ///< largest entry of a step
  const Inputs& recovery;     ///< the same on the way back below a limit; counts where it is larger
  const InputMatrix& metric;  ///< what turns the slope of J into the step: symmetric, positive definite
};

class ConstraintFilter {
 public:
  /// `memory` is the number of cycles that the learnt slopes look back.
  ConstraintFilter(std::vector<Limit> limits, Eigen::Index inputs, double memory);

  std::size_t size() const noexcept { return limits_.size(); }
  const std::vector<Limit>& limits() const noexcept { return limits_; }
  LimitState state(std::size_t i) const noexcept;
  /// The delay at which limit i is read, as far as the readings tell [cycles].
  double delay_cycles(std::size_t i) const noexcept { return causes_.delay_cycles(i); }
  /// Cycles until every limit is read at an input that has stayed; 0 where none is delayed or lagged.
  std::int64_t settling() const noexcept { return causes_.settling(); }

  /// Learns from one cycle: the input that was applied and the values that it gave.
  void record(const Inputs& applied, std::span<const double> values) noexcept;
  /// A cycle in which nothing was read: what comes late moves on.
  void skip(const Inputs& applied) noexcept {
    if (settling() > 0) causes_.record(applied);
  }

  /// What penalty and barrier add to J (to be maximised) for these values, <= 0 for penalties; of a limit that comes
  /// late, for what is predicted at the applied input.
  double shaping(const Inputs& applied, std::span<const double> values) const noexcept;

  /// Predicted excess of the worst point within `reach` of `at` over limit i, in the unit of the limit.
  double excess(std::size_t i, const Inputs& at, const Inputs& reach) const noexcept;
  /// The largest predicted excess over the limits, in their scales; at most 0 where all are kept.
  double worst_excess(const Inputs& at) const noexcept;

  /// What has been learnt of limit i.
  const LocalModel& model(std::size_t i) const noexcept { return models_[i]; }

  /// What limit i keeps free, scatter and what its readings have asked for included, in its unit.
  double margin(std::size_t i) const noexcept;

  /// The step within its rate, or where a limit forbids that, the nearest one in the metric of the seeker that no limit
  /// forbids, and that stays within the bounds. Where the estimate itself is over a limit: the way back along the
  /// learnt slopes, or to the last good point while the slope is not known (with no such point the estimate stays,
  /// unless the reach is zero and nothing but steps explores, or the limit has been broken for long without showing a
  /// slope: it cannot say where to go and is not waited for). Limits that cannot be met together are broken by as
  /// little as possible, counted in their scales. While a late limit has not been read yet, a seeker that dithers does
  /// not step.
  Inputs project(const Inputs& estimate, const Inputs& step, const StepFrame& frame) noexcept;

  /// True when the last `project` changed its step.
  bool active() const noexcept { return active_; }
  /// True after three cycles in a row over the same limit: do not wait for the end of a window.
  bool alarmed() const noexcept;

  /// A new operating point: what was learnt is void, the last good point too.
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    for (std::size_t i = 0; i < self.models_.size(); ++i)
      LocalModel::visit(self.models_[i], v, "limit" + std::to_string(i));
    v("limit_extra", self.extra_);
    v("limit_in_a_row", self.in_a_row_);
    v("limit_good", self.good_);
    v("limit_has_good", self.has_good_);
    v("limit_active", self.active_);
    v("limit_binding", self.binding_);
    v("limit_contradicted", self.contradicted_);
    CausingInputs::visit(self.causes_, v, "limit_cause");
  }

 private:
  bool silent(std::size_t i, double excess) const noexcept;
  bool admits(const Inputs& step) const noexcept;
  Inputs turn(const Inputs& estimate, const Inputs& step, const StepFrame& frame, double worst_excess) noexcept;

  std::vector<Limit> limits_;
  CausingInputs causes_;
  double memory_, patience_;        // cycles that a broken limit is given to show its slope
  std::vector<LocalModel> models_;  // one per limit
  std::vector<double> extra_;       // margin that the share of readings above has asked for, in the unit of the limit
  std::vector<double> in_a_row_;
  std::vector<double> binding_;       // 1 where the limit turned the last step or is broken
  std::vector<double> contradicted_;  // steps in a row without any that would meet it
  std::vector<Inputs> slopes_;        // of the step at work
  std::vector<double> over_;          // excess at its estimate, in the unit of the limit
  NearestStep nearest_;
  Inputs good_;
  bool has_good_ = false;
  bool active_ = false;
};

/// State of limit i of any seeker, or of what stands around one.
template <class S>
LimitState limit_state_of(const S& seeker, std::size_t i) noexcept {
  if constexpr (requires { seeker.limit_state(i); }) {
    return seeker.limit_state(i);
  } else {
    return seeker.filter().state(i);
  }
}

/// By how much an input is expected over a limit, in its scale; 0 of a seeker that does not say.
template <class S>
double excess_of(const S& seeker, const Inputs& at) noexcept {
  if constexpr (requires { seeker.excess(at); }) return seeker.excess(at);
  return 0.0;
}

/// The delay at which limit i is read, as far as the readings tell [cycles].
template <class S>
double limit_delay_of(const S& seeker, std::size_t i) noexcept {
  if constexpr (requires { seeker.limit_delay(i); }) {
    return seeker.limit_delay(i);
  } else {
    return seeker.filter().delay_cycles(i);
  }
}

}  // namespace mgdd::optimize
