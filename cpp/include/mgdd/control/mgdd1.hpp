// The plainest model-guided step: one duty over the horizon, moved along the slope of what any model *says*, found by
// asking it twice more. No parameter of the model is read, so a black box guides as well as a physical one. With the
// adaptation gain 1 it is a Gauss-Newton step; below 1 a gradient scheme. Angles in deg, duty -1..1, time in s.
// `step` is noexcept and allocation-free where the model's is. Source: our reading of the adaptation by model outputs
// in Tan 2018, section 7.3; finite differences as in Nocedal and Wright 2006, section 8.1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/control/duty_range.hpp"
#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/sent_duties.hpp"
#include "mgdd/control/slow_trim.hpp"
#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/observer.hpp"

namespace mgdd::control {

struct Mgdd1Settings {
  int horizon_samples = 16;  ///< of the model
  int delay_samples = 1;     ///< from a duty to its effect: 0 to `longest_control_delay`
  double adaptation_gain = 1.0;
  double difference = 0.02;          ///< [-] of the duty, for the slope
  double error_weight = 1.0;         ///< per deg²
  double duty_change_weight = 20.0;  ///< per duty²
  double trim_rate_per_deg_s = 0.3;  ///< slow integral that the model does not see
  ReferenceRate reference{};
  DutyRange duty{};

  bool operator==(const Mgdd1Settings&) const = default;
};

std::span<const Field<Mgdd1Settings>> mgdd1_fields() noexcept;

/// ParameterError naming field, value and bound.
void validate(const Mgdd1Settings& settings);

/// A model that an observer of fixed gains can pull toward a measured angle.
template <class M, class Gains>
concept Guide = dynamics::StartsAtRest<M> && std::floating_point<typename M::Scalar> &&
                requires(const M& model, typename M::State& state, typename M::Scalar y, const Gains& gains) {
                  { model.correct(state, y, gains) } noexcept;
                };

template <class M, class Gains>
  requires Guide<M, Gains>
class Mgdd1 {
 public:
  using T = typename M::Scalar;

  Mgdd1(const M& model, const Mgdd1Settings& settings, const Gains& gains = {})
      : settings_((validate(settings), settings)),
        observer_(model, gains),
        reference_(settings.reference.lag_s, model.sample_s(), settings.reference.jump_deg_per_s) {}

  /// Duty of this sample. Inputs that are not finite repeat the last reference or correct nothing; before the first
  /// finite ones the duty is 0.
  T step(T reference_deg, T measurement_deg) noexcept {
    reference_.step(reference_deg);
    if (!started_) {
      if (!std::isfinite(measurement_deg) || !reference_.started()) return duty_;
      observer_.start(observer_.model().at_rest(measurement_deg));
      started_ = true;
    } else {
      observer_.update(sent_.before[static_cast<std::size_t>(settings_.delay_samples)], measurement_deg);
    }
    auto ahead = observer_.state();
    const M& model = observer_.model();
    for (int i = settings_.delay_samples - 1; i >= 0; --i)
      model.step(ahead, dynamics::input_of(model, sent_.before[static_cast<std::size_t>(i)]));
    adapt(ahead);
    sent_.push(move_);
    trim_ = trimmed(trim_, reference_.value() - measurement_deg, settings_.trim_rate_per_deg_s, model.sample_s());
    duty_ = settings_.duty.clamp(move_ + trim_);
    return duty_;
  }

  /// The duty that was really sent in the place of the last one, where a gate changed it. Ignored if not finite.
  void set_sent(T duty) noexcept {
    if (started_) correct_sent(sent_, duty_, settings_.duty, duty);
  }

  void reset() noexcept {
    started_ = false;
    reference_.forget();
    observer_.start({});
    sent_.fill(T(0.0));
    move_ = trim_ = duty_ = T(0.0);
  }

  const Mgdd1Settings& settings() const noexcept { return settings_; }
  const M& model() const noexcept { return observer_.model(); }
  T duty() const noexcept { return duty_; }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const { require_usable_duty(duty_, settings_.duty); }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("started", self.started_);
    Prefixed<V> model{v, "model_"};
    decltype(self.observer_)::visit(self.observer_, model);
    FilteredRate<T>::visit(self.reference_, Prefixed<V>{v, "reference_"});
    visit_sent(self.sent_, v);
    visit_number(v, "move", self.move_);
    visit_number(v, "trim", self.trim_);
    visit_number(v, "duty", self.duty_);
  }

 private:
  using Observer = dynamics::FixedGainObserver<M, Gains>;

  // u moves by -gain (sum w_e (y - r) s + w_u (u - u_last)) / (sum w_e s² + w_u), s the slope of the model's output.
  void adapt(const typename M::State& ahead) noexcept {
    const M& model = observer_.model();
    const T half = T(settings_.difference);
    auto middle = ahead, above = ahead, below = ahead;
    const auto u = dynamics::input_of(model, move_);
    const auto more = dynamics::input_of(model, T(move_ + half)), less = dynamics::input_of(model, T(move_ - half));
    const T weight = T(settings_.duty_change_weight);
    T gradient = weight * (move_ - sent_.before[0]), curvature = weight;
    for (int k = 1; k <= settings_.horizon_samples; ++k) {
      model.step(middle, u);
      model.step(above, more);
      model.step(below, less);
      const T slope = (model.output(above) - model.output(below)) / (T(2.0) * half);
      const T target = reference_.value() + reference_.rate() * T(model.sample_s()) * T(k);
      gradient += T(settings_.error_weight) * (model.output(middle) - target) * slope;
      curvature += T(settings_.error_weight) * slope * slope;
    }
    const T step = T(settings_.adaptation_gain) * gradient / (curvature + T(1e-9));
    move_ = settings_.duty.clamp(move_ - step);
  }

  Mgdd1Settings settings_;
  Observer observer_;
  FilteredRate<T> reference_;
  bool started_ = false;
  SentDuties<T> sent_{};  // duties without trim
  T move_{0.0}, trim_{0.0}, duty_{0.0};
};

}  // namespace mgdd::control
