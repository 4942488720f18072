// A plate as a predictive controller follows it under one delay: its state, and what is learnt of dry friction, gain
// and damping. A measurement moves angle and speed by fixed shares (Luenberger 1966); what it says of the belief is the
// friction learner's. Angles in deg, duty -1..1, time in s. noexcept, heap-free.
#pragma once

#include <algorithm>

#include "mgdd/common/state.hpp"
#include "mgdd/control/friction_learner.hpp"
#include "mgdd/control/plate_model.hpp"

namespace mgdd::control {

template <class B, class V>
void visit_belief(B& belief, V&& v) {
  visit_number(v, "bias_above", belief.above.bias);
  visit_number(v, "friction_above", belief.above.friction);
  visit_number(v, "bias_below", belief.below.bias);
  visit_number(v, "friction_below", belief.below.friction);
  visit_number(v, "gain_factor", belief.gain_factor);
  visit_number(v, "damping_factor", belief.damping_factor);
}

/// How a measurement moves a predicted state, inside the travel.
template <class T>
struct PlateCorrection {
  T angle_share, speed_gain;
  T closed_deg, open_deg;

  /// Gives the innovation [deg].
  T correct(PlateState<T>& state, T measurement_deg) const noexcept {
    const T innovation = measurement_deg - state.angle_deg;
    state.angle_deg = std::clamp(state.angle_deg + angle_share * innovation, closed_deg, open_deg);
    state.speed_deg_per_s += speed_gain * innovation;
    return innovation;
  }
};

template <class T>
struct PlateObserver {
  PlateState<T> state{};
  PlateBelief<T> belief{};
  FrictionLearner<T> learner;
  T mean_torque{0.0};
  T innovation{0.0};  ///< measured less predicted angle [deg]

  // Before the last correction; read by `learn` of the same sample.
  PlateState<T> predicted{};
  T last_innovation{0.0};

  /// At rest under a held duty; what was learnt stays.
  void start(const PlateState<T>& at_rest) noexcept {
    state = at_rest;
    mean_torque = at_rest.torque;
    innovation = T(0.0);
    learner.forget();
  }
  /// The duty that acts now.
  void predict(PlateModel<T>& model, T acting) noexcept {
    model.believe(belief);
    mean_torque = model.mean_torque(state, acting);
    model.step(state, acting);
  }
  void correct(const PlateCorrection<T>& gains, T measurement_deg) noexcept {
    predicted = state;
    last_innovation = innovation;
    innovation = gains.correct(state, measurement_deg);
  }
  /// What the correction says of the belief; nothing where a stop holds the plate.
  void learn(PlateModel<T>& model, bool stopped) noexcept {
    if (stopped) {
      learner.forget();
      return;
    }
    FrictionBand<T>& band = model.is_below(predicted.angle_deg) ? belief.below : belief.above;
    const T push = mean_torque - model.holding(predicted.angle_deg);
    if (predicted.speed_deg_per_s != T(0.0)) {
      model.believe(belief);
      learner.slide(belief, band, innovation, {push, predicted.speed_deg_per_s, model.damped()});
      return;
    }
    const T moves = learner.stick(band, innovation, last_innovation, push);
    const T now = state.speed_deg_per_s;
    state.speed_deg_per_s = moves > T(0.0) ? std::max(now, moves) : std::min(now, moves);
  }

  template <class Self, class V>
  static void visit(Self& self, V&& v) {
    visit_number(v, "angle_deg", self.state.angle_deg);
    visit_number(v, "speed_deg_per_s", self.state.speed_deg_per_s);
    visit_number(v, "torque", self.state.torque);
    visit_number(v, "mean_torque", self.mean_torque);
    visit_number(v, "innovation_deg", self.innovation);
    visit_belief(self.belief, v);
    FrictionLearner<T>::visit(self.learner, Prefixed<V>{v, "slope_"});
  }
};

}  // namespace mgdd::control
