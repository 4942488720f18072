// Model-guided predictive controller of a throttle plate: a rough model predicts a short horizon, one Gauss-Newton step
// per sample moves the last duties along its exact slopes, and what is measured corrects the model while it runs.
// The default learns dry friction as two levels per side of limp-home, gain and damping, asks the model for the duty at
// which the plate breaks away, since a stuck plate has no slope, and holds still inside the friction band. Without
// learning it is the plain form: friction by tanh, one bias, a slow trim. A linear prediction makes it the usual linear
// MPC, more Gauss-Newton steps make it the converged nonlinear one. Angles in deg, duty -1..1, time in s. `step` is
// noexcept and allocation-free, on double and float. One Gauss-Newton step per sample: Diehl et al. 2005; learning and
// hold rules are our own. Defaults fit the throttle P1.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/field.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/control/duty_range.hpp"
#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/friction_learner.hpp"
#include "mgdd/control/plate.hpp"

namespace mgdd::control {

inline constexpr int n_guided_moves = 3;
inline constexpr int longest_guided_horizon = 64;  ///< prediction steps
inline constexpr int longest_guided_delay = 5;     ///< samples

/// What the horizon is predicted with.
enum class Prediction {
  nonlinear,  ///< springs and friction as they are
  linear,     ///< the spring of the measured side without end, friction only fed forward: a linear-quadratic step
};
Names<Prediction> prediction_names() noexcept;

/// How a prediction knows its side of limp-home.
enum class SideSwitching {
  predicted,  ///< by the predicted angle
  measured,   ///< that of the last measurement, with a dead band of 0.3 deg
};
Names<SideSwitching> side_switching_names() noexcept;

struct GuidedPredictiveSettings {
  double sample_s = 1e-3;
  PlateSettings plate{};  ///< the guide
  int delay_samples = 1;  ///< from a duty to its effect, beside the electrical lag: 0 to 5

  // The horizon.
  Prediction prediction = Prediction::nonlinear;
  SideSwitching switching = SideSwitching::predicted;
  double prediction_step_s = 2e-3;
  std::array<int, n_guided_moves> move_steps{3, 5, 12};  ///< prediction steps for which each duty is held
  int gauss_newton_steps = 1;                            ///< at most, per sample

  // The performance function: per prediction step, and per change from move to move.
  double error_weight = 1.0;        ///< per deg²
  double speed_weight = 0.0;        ///< per (deg/s)²
  double duty_change_weight = 4.0;  ///< per duty²

  // Constraints: hard for the duty and its rate; predicted angles beyond theirs cost `angle_limit_weight` per deg².
  double lower = -1.0;
  double upper = 1.0;
  double duty_rate_per_s = 1e4;
  double lowest_deg = -1e3;
  double highest_deg = 1e3;
  double angle_limit_weight = 20.0;

  // The observer, and what it learns.
  double observer_angle_per_s = 430.0;
  double observer_speed_per_s2 = 28000.0;
  double noise_deg = 0.03;  ///< of the measured angle: what counts as motion
  bool friction_learning = true;
  FrictionLearnerSettings learner{};
  double bias_rate_per_deg_s = 4.0;  ///< without learning
  double trim_rate_per_deg_s = 0.3;  ///< without learning: invisible to the prediction

  // The reference.
  double reference_lag_s = 4.5e-3;
  double reference_jump_deg_per_s = 400.0;  ///< a faster reference steps: it has no rate

  bool operator==(const GuidedPredictiveSettings&) const = default;
};

/// All numbers of the settings, in the order in which Python shows them.
inline constexpr std::size_t n_guided_predictive_fields = 35;
std::span<const Field<GuidedPredictiveSettings>, n_guided_predictive_fields> guided_predictive_fields() noexcept;

/// ParameterError naming field, value and bound.
void validate(const GuidedPredictiveSettings& settings);

/// ParameterError for levels that learning with these settings could not have reached.
void require_usable_belief(const PlateBelief<double>& belief, const GuidedPredictiveSettings& settings);

template <class T>
class BasicGuidedPredictive {
 public:
  explicit BasicGuidedPredictive(const GuidedPredictiveSettings& settings);

  /// Duty of this sample: `prepare` and `feedback`. Inputs that are not finite repeat the last reference or correct
  /// nothing; before the first finite ones the duty is 0.
  T step(T reference_deg, T measurement_deg) noexcept { return step(reference_deg, measurement_deg, {}); }
  /// With the references of the next samples; a short preview goes on at its last value. Entries that are not finite
  /// end it.
  T step(T reference_deg, T measurement_deg, std::span<const T> preview_deg) noexcept;

  /// The part that needs no measurement: the model up to this sample. May run while the sensor is being read.
  void prepare() noexcept;
  /// The rest; prepares first where nobody has.
  T feedback(T reference_deg, T measurement_deg, std::span<const T> preview_deg = {}) noexcept;
  /// One more Gauss-Newton step on the same sample while there is time; the duty is feasible after every one.
  T refine() noexcept;

  /// As made, with what was learnt forgotten.
  void reset() noexcept;
  /// Takes over from a duty at rest, what was learnt kept. Ignored if a number is not finite.
  void take_over(T measurement_deg, T duty) noexcept;

  /// What was learnt, and a start from it. ParameterError for levels that learning could not have reached.
  const PlateBelief<T>& belief() const noexcept { return belief_; }
  void set_belief(const PlateBelief<T>& belief);

  const GuidedPredictiveSettings& settings() const noexcept { return settings_; }
  T duty() const noexcept { return duty_; }
  T innovation_deg() const noexcept { return innovation_; }  ///< measured less predicted angle of the last sample
  bool holds() const noexcept { return holds_; }             ///< whether the plate is held where it is stuck

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("started", self.started_);
    v("prepared", self.prepared_);
    v("holds", self.holds_);
    v("above_limp_home", self.above_);
    v("still_samples", self.still_);
    visit_number(v, "angle_deg", self.state_.angle_deg);
    visit_number(v, "speed_deg_per_s", self.state_.speed_deg_per_s);
    visit_number(v, "torque", self.state_.torque);
    visit_number(v, "mean_torque", self.mean_torque_);
    visit_number(v, "bias_above", self.belief_.above.bias);
    visit_number(v, "friction_above", self.belief_.above.friction);
    visit_number(v, "bias_below", self.belief_.below.bias);
    visit_number(v, "friction_below", self.belief_.below.friction);
    visit_number(v, "gain_factor", self.belief_.gain_factor);
    visit_number(v, "damping_factor", self.belief_.damping_factor);
    FrictionLearner<T>::visit(self.learner_, Prefixed<V>{v, "slope_"});
    FilteredRate<T>::visit(self.reference_, Prefixed<V>{v, "reference_"});
    for (std::size_t i = 0; i < self.sent_.size(); ++i)
      visit_number(v, names_of_sent[i], self.sent_[i]);
    for (std::size_t i = 0; i < self.moves_.size(); ++i)
      visit_number(v, names_of_moves[i], self.moves_[i]);
    visit_number(v, "innovation_deg", self.innovation_);
    visit_number(v, "mean_error_deg", self.mean_error_);
    visit_number(v, "trim", self.trim_);
    visit_number(v, "duty", self.duty_);
  }

 private:
  static constexpr std::size_t n = n_guided_moves;
  static constexpr std::array<const char*, longest_guided_delay + 1> names_of_sent{"sent_0", "sent_1", "sent_2",
                                                                                   "sent_3", "sent_4", "sent_5"};
  static constexpr std::array<const char*, n> names_of_moves{"move_0", "move_1", "move_2"};
  using Moves = std::array<T, n>;

  /// One problem of the horizon: what is predicted from, to where, and where the first duty may lie.
  struct Horizon {
    PlateState<T> ahead{};  // when the first duty acts
    std::array<T, longest_guided_horizon> target{};
    T before{0.0};  // the duty before it, without trim
    T acting{0.0};  // and with it
    T lowest{0.0}, highest{0.0};
    T aim{0.0};     // where it shall be soon
    T wanted{0.0};  // way that it shall go
  };

  int n_steps() const noexcept { return settings_.move_steps[0] + settings_.move_steps[1] + settings_.move_steps[2]; }
  void start(T angle_deg, T duty) noexcept;
  void correct(T measurement_deg) noexcept;
  void look_ahead(T measurement_deg, std::span<const T> preview_deg) noexcept;
  bool hold_still() noexcept;
  void break_away() noexcept;
  T send() noexcept;
  T performance(std::span<const T> output) const noexcept;
  bool gauss_newton() noexcept;
  FrictionBand<T>& band_at(T angle_deg) noexcept;

  GuidedPredictiveSettings settings_;
  PlateModel<T> observed_;   // one sample at a time
  PlateModel<T> predicted_;  // one prediction step at a time
  T angle_share_, speed_gain_;
  FrictionLearner<T> learner_;

  bool started_ = false, prepared_ = false, holds_ = false, above_ = true;
  std::int64_t still_ = 0;
  PlateState<T> state_{};
  T mean_torque_{0.0};
  PlateBelief<T> belief_{};
  FilteredRate<T> reference_;
  std::array<T, longest_guided_delay + 1> sent_{};  // the last one first
  Moves moves_{};
  T innovation_{0.0}, mean_error_{0.0}, trim_{0.0}, duty_{0.0};
  Horizon horizon_{};  // of the last sample, for `refine`
};

using GuidedPredictive = BasicGuidedPredictive<double>;
extern template class BasicGuidedPredictive<double>;
extern template class BasicGuidedPredictive<float>;

}  // namespace mgdd::control
