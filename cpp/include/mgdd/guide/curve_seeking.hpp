// Curve-guided seeking of one input: the guide's whole curve gives the shape, the measurements give the place. A filter
// over the place of the curve (`CurveFilter`) takes every reading; the next input lies one standard deviation of the
// place to one side of its mean or the other, at least as far as keeping track costs least, every eighth time at it.
// Kin: self-tuning extremum control (Wellstead and Zarrop 1991). The sides have no period and the delay of the readings
// is learnt about the one told. Readings that the curve cannot explain raise a doubt: banks of short memory begin anew,
// the others keep what they know until these foretell better. A guide that keeps failing hands over to plain extremum
// seeking. Behind a slow sensor a side is held for two time constants of its lag, which would blot out a faster change.
// ask and tell are noexcept and allocation-free.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>
#include <vector>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/guide/curve.hpp"
#include "mgdd/guide/curve_filter.hpp"
#include "mgdd/guide/limit_curves.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/laws/dither.hpp"
#include "mgdd/optimize/laws/extremum_seeking.hpp"

namespace mgdd::guide {

struct CurveSeekingSettings {
  optimize::SearchSpace space;  ///< one input, finite bounds
  Curve curve;                  ///< the guide's J to begin with, to be maximised; it must bend down at its best input
  /// How far the plant's best input may lie from the guide's: one standard deviation, input unit; 0 = a quarter of the
  /// bounds.
  double prior_sd = 0.0;
  double scale_sd = 0.3;             ///< of the plant's curvature over the guide's, about 1
  double discrepancy = 0.25;         ///< error of the curve per unit of its drop
  std::optional<double> noise_sd{};  ///< of one reading of J, > 0; none: learnt
  double memory_cycles = 143.0;      ///< readings fade with this time constant
  double amplitude_max = 0.0;        ///< largest distance from the estimate that is applied; 0 = 0.25 prior_sd
  std::optional<double> rate{};      ///< largest change of the applied input per cycle; none: no bound
  optimize::ComponentLag sensor{};   ///< between the plant and J; the delay is rounded to whole cycles
  int delay_uncertainty = 4;         ///< cycles by which the delay may be shorter or longer: it is learnt
  bool hand_over = true;             ///< to plain extremum seeking where the guide keeps failing
  bool maximize = true;
  std::vector<optimize::Limit> limits{};
  std::vector<Curve> limit_curves{};  ///< of the guide, one per limit, or none: then their slopes are learnt by trying
};
inline auto fields_of(const CurveSeekingSettings&) {
  using S = CurveSeekingSettings;
  using Lag = optimize::ComponentLag;
  const auto own = [](const char* name, const char* meaning) {
    return FieldInfo{name, "-", above(0.0), meaning, DefaultForm::none};
  };
  return std::tuple{
      optimize::space_fields<&S::space>(),
      field<&S::curve>("curve", "the guide's J", DefaultForm::required),
      field<&S::prior_sd>(own("prior_sd", "how far the best input may lie from the guide's")),
      field<&S::scale_sd>("scale_sd", "of the plant's curvature over the guide's"),
      field<&S::discrepancy>("discrepancy", "error of the curve per unit of its drop"),
      field<&S::noise_sd>("noise_sd", "of one reading of J"),
      field<&S::memory_cycles>("memory_cycles", "time constant with which readings fade"),
      field<&S::amplitude_max>(own("amplitude_max", "largest distance from the estimate that is applied")),
      field<&S::rate>("rate", "largest change of the applied input per cycle"),
      field<&S::sensor, &Lag::delay_cycles>("delay_cycles", "between the plant and J"),
      field<&S::sensor, &Lag::lag_cycles>("lag_cycles", "the same"),
      field<&S::delay_uncertainty>("delay_uncertainty", "cycles by which the delay may be shorter or longer"),
      field<&S::hand_over>("hand_over", "to plain extremum seeking where the guide keeps failing"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::limit_curves>("limit_curves", "of the guide, one per limit", DefaultForm::none),
  };
}

class CurveSeeking {
 public:
  /// Throws ParameterError or ShapeError naming the field.
  explicit CurveSeeking(CurveSeekingSettings settings);

  const optimize::Inputs& ask() noexcept;
  optimize::TellStatus tell(const optimize::Reading& reading) noexcept;

  /// The operating point has changed and the guide's curve with it: the distance between the plant's best input and
  /// the guide's is kept, with a doubt of a fifth of `prior_sd`. False where the curve does not bend down at its best
  /// input or that lies out of bounds: then the old one stays, as `restart` does.
  bool guide(const Curve& curve) noexcept { return guide(curve, {}); }
  /// The same with the curves of the limits; empty: the old ones.
  bool guide(const Curve& curve, std::span<const Curve> limit_curves) noexcept;
  /// Another curve at the same operating point, as a calibration of the guide draws it, whose best input is known to
  /// `sd` (at most `prior_sd` counts): what the readings said stays, and they decide beside it. False as for `guide`;
  /// nothing has changed then.
  bool believe(const Curve& curve, double sd) noexcept;
  /// The operating point has changed and the guide says nothing of it.
  void restart() noexcept;

  /// Moves the estimate, as a feed-forward does; what the readings said of the place is void.
  void shift_estimate(const optimize::Inputs& by) noexcept;

  const optimize::Inputs& estimate() const noexcept { return estimate_; }
  /// By how much an input is expected over a limit, in its scale; at most 0 where all are kept.
  double excess(const optimize::Inputs& at) const noexcept {
    return limits_.size() > 0 ? limits_.excess(at[0]) : -optimize::unlimited;
  }
  double estimate_sd() const noexcept;  ///< of the estimate as stated; NaN after a hand-over
  double noise_sd() const noexcept { return filter_.noise_sd(); }
  double scale() const noexcept { return filter_.scale(); }
  /// Whole cycles between input and reading that explain the readings best.
  std::int64_t delay_cycles() const noexcept {
    return delay_ + (plain_at_work_ ? delay_error_ : filter_.delay_error());
  }
  /// False where enough readings were told and J has not been seen to answer the input: the estimate is the guide's.
  bool answered() const noexcept;
  /// 1: what the curve leaves unexplained is noise, and J is as steep as it says; towards 0: it is not, or J is not, by
  /// the ratio of the two; 0 after a hand-over.
  double trust() const noexcept;
  std::int64_t doubts() const noexcept { return doubts_; }
  bool handed_over() const noexcept { return plain_at_work_; }
  const Curve& curve() const noexcept { return filter_.curve(); }  ///< of the guide, now
  const CurveSeekingSettings& settings() const noexcept { return settings_; }
  const optimize::Inputs& applied() const noexcept { return protocol_.sent(applied_); }
  const optimize::Protocol& protocol() const noexcept { return protocol_; }
  std::size_t component_count() const noexcept { return 1; }
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }
  optimize::LimitState limit_state(std::size_t i) const noexcept { return limits_.state(i); }
  double limit_delay(std::size_t i) const noexcept { return limits_.delay_cycles(i); }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    optimize::require_within_space("estimate", estimate_, settings_.space);
    optimize::require_within_space("applied", applied_, settings_.space);
    require_in(above(0.0, 1e12), "taken_over_scale", taken_over_scale_);
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    optimize::Protocol::visit(self.protocol_, v);
    v("estimate", self.estimate_);
    v("applied", self.applied_);
    v("upwards", self.upwards_);
    v("sent", self.sent_);
    v("sent_count", self.sent_count_, counts_end);
    v("held_back", self.held_back_);
    v("held_count", self.held_count_, counts_end);
    v("delay_error", self.delay_error_, -std::int64_t{self.settings_.delay_uncertainty},
      std::int64_t{self.settings_.delay_uncertainty} + 1);
    v("surprise", self.surprise_);
    v("doubts", self.doubts_, counts_end);
    v("since_doubt", self.since_doubt_, counts_end);
    v("doubt_rate", self.doubt_rate_);
    v("repeat_input", self.repeat_input_);
    v("repeat_j", self.repeat_j_);
    v("repeat_known", self.repeat_known_);
    v("repeat_variance", self.repeat_variance_);
    v("repeats", self.repeats_, counts_end);
    v("plain_at_work", self.plain_at_work_);
    v("taken_over_at", self.taken_over_at_);
    v("taken_over_scale", self.taken_over_scale_);
    LimitCurves::visit(self.limits_, v);
    CurveFilter::visit(self.filter_, v);
    Prefixed<V> plain{v, "plain_"};
    optimize::ExtremumSeeking::visit(self.plain_, plain);
  }

 private:
  double amplitude() const noexcept;
  double within_limits(double wanted) noexcept;
  double allowed_mean() noexcept;
  double explained() const noexcept;
  void learn(double applied, double j) noexcept;
  void watch_repeats(double applied, double j) noexcept;
  void judge_surprise(double surprise) noexcept;
  void take_over() noexcept;
  void tell_plain(double j, double applied) noexcept;
  double last_held() const noexcept;
  void begin_at(const Curve& curve, double mean, double sd) noexcept;
  bool usable(const Curve& curve) const noexcept;

  CurveSeekingSettings settings_;
  CurveFilter filter_;
  LimitCurves limits_;
  optimize::ExtremumSeeking plain_;  // about `taken_over_at_`, once it is at work
  optimize::Protocol protocol_;
  optimize::Inputs estimate_, applied_;
  std::int64_t delay_, hold_;  // cycles: of the sensor, and on one side
  bool upwards_ = true;        // side of the next input
  std::vector<double> sent_;   // inputs on their way through the delay, a ring
  std::int64_t sent_count_ = 0;
  std::vector<double> held_back_;  // readings after a hand-over, a ring
  std::int64_t held_count_ = 0, delay_error_ = 0;
  double surprise_ = 1.0;  // running mean of the squared normalised innovation
  std::int64_t doubts_ = 0, since_doubt_ = 0;
  double doubt_rate_ = 0.0;                            // of late
  std::array<double, 2> repeat_input_{}, repeat_j_{};  // last reading on either side, to tell noise from misfit
  std::array<double, 2> repeat_known_{};
  double repeat_variance_ = 0.0;
  std::int64_t repeats_ = 0;
  bool plain_at_work_ = false;
  double taken_over_at_ = 0.0, taken_over_scale_ = 1.0;  // estimate, and height of J over the guide's, as learnt
};

}  // namespace mgdd::guide
