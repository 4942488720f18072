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
#include <type_traits>

#include "mgdd/common/state.hpp"
#include "mgdd/control/belief_review.hpp"
#include "mgdd/control/delay_bank.hpp"
#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/guided_horizon.hpp"
#include "mgdd/control/guided_predictive_settings.hpp"
#include "mgdd/control/plate_observer.hpp"
#include "mgdd/control/sent_duties.hpp"

namespace mgdd::control {

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
  /// The duty that was really sent in the place of the last one, where a gate changed it. Ignored if not finite.
  void set_sent(T duty) noexcept;
  /// Takes over from a duty at rest, what was learnt kept. Ignored if a number is not finite.
  void take_over(T measurement_deg, T duty) noexcept;

  /// What was learnt, and a start from it. ParameterError for levels that learning could not have reached.
  const PlateBelief<T>& belief() const noexcept { return now().belief; }
  void set_belief(const PlateBelief<T>& belief);
  /// The last belief that predicted well for long, to which a worse one is rolled back; how often that was.
  const PlateBelief<T>& certified() const noexcept { return proven_.belief(); }
  std::int64_t rollbacks() const noexcept { return rollbacks_; }

  const GuidedPredictiveSettings& settings() const noexcept { return settings_; }
  T duty() const noexcept { return duty_; }
  T innovation_deg() const noexcept { return now().innovation; }  ///< measured less predicted angle of the last sample
  bool holds() const noexcept { return holds_; }                  ///< whether the plate is held where it is stuck

  /// Samples from a duty to its effect as the readings have them; `delay_samples` until they say otherwise.
  int delay_samples() const noexcept { return settings_.delay_samples + bank_.chosen(); }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("started", self.started_);
    v("prepared", self.prepared_);
    v("holds", self.holds_);
    v("above_limp_home", self.above_);
    v("still_samples", self.still_, counts_end);
    PlateObserver<T>::visit(self.members_[0], v);
    for (std::size_t j = 1; j < most_delays; ++j)
      PlateObserver<T>::visit(self.members_[j], Prefixed<V>{v, names_of_members[j]});
    DelayBank<T>::visit(self.bank_, Prefixed<V>{v, "delay_"});
    auto certified = self.proven_.belief();
    visit_belief(certified, Prefixed<V>{v, "certified_"});
    if constexpr (!std::is_const_v<Self>) self.proven_.believe(certified);
    visit_number(v, "certified_angle_deg", self.proven_state_.angle_deg);
    visit_number(v, "certified_speed_deg_per_s", self.proven_state_.speed_deg_per_s);
    visit_number(v, "certified_torque", self.proven_state_.torque);
    BeliefReview<T>::visit(self.review_, Prefixed<V>{v, "review_"});
    v("rollbacks", self.rollbacks_, counts_end);
    FilteredRate<T>::visit(self.reference_, Prefixed<V>{v, "reference_"});
    visit_sent(self.sent_, v);
    for (std::size_t i = 0; i < self.moves_.size(); ++i)
      visit_number(v, names_of_moves[i], self.moves_[i]);
    visit_number(v, "mean_error_deg", self.mean_error_);
    visit_number(v, "trim", self.trim_);
    visit_number(v, "duty", self.duty_);
  }

 private:
  static constexpr std::size_t n = n_guided_moves;
  static constexpr std::array<const char*, n> names_of_moves{"move_0", "move_1", "move_2"};
  static constexpr std::array<const char*, most_delays> names_of_members{"",        "late_1_", "late_2_", "late_3_",
                                                                         "late_4_", "late_5_", "late_6_"};
  void start(T angle_deg, T duty) noexcept;
  void correct(T measurement_deg) noexcept;
  bool review(T innovation, bool slides) noexcept;
  void look_ahead(T measurement_deg, std::span<const T> preview_deg) noexcept;
  bool hold_still() noexcept;
  void break_away() noexcept;
  T send() noexcept;
  bool gauss_newton() noexcept { return gauss_newton_step(predicted_, settings_, horizon_, moves_); }
  const PlateObserver<T>& now() const noexcept { return members_[static_cast<std::size_t>(bank_.chosen())]; }
  PlateObserver<T>& now() noexcept { return members_[static_cast<std::size_t>(bank_.chosen())]; }
  std::span<PlateObserver<T>> members() noexcept {
    return std::span(members_).first(static_cast<std::size_t>(bank_.members()));
  }

  GuidedPredictiveSettings settings_;
  PlateModel<T> observed_;   // one sample at a time, with the belief of whom it steps
  PlateModel<T> predicted_;  // one prediction step at a time
  PlateModel<T> proven_;     // `observed_` with the certified belief
  PlateCorrection<T> gains_;
  T slow_;
  DelayBank<T> bank_;
  std::array<PlateObserver<T>, most_delays> members_;  // of the delay that is given and the longer ones
  BeliefReview<T> review_;

  bool started_ = false, prepared_ = false, holds_ = false, above_ = true;
  std::int64_t still_ = 0;
  PlateState<T> proven_state_{};
  FilteredRate<T> reference_;
  SentDuties<T> sent_{};  // duties without trim
  GuidedMoves<T> moves_{};
  std::int64_t rollbacks_ = 0;
  T mean_error_{0.0}, trim_{0.0}, duty_{0.0};
  GuidedHorizon<T> horizon_{};  // of the last sample, for `refine`
};

using GuidedPredictive = BasicGuidedPredictive<double>;
extern template class BasicGuidedPredictive<double>;
extern template class BasicGuidedPredictive<float>;

}  // namespace mgdd::control
