// Re-anchoring observer of a pseudo-Wiener model: predicts with the duty that acted, then pulls to the measurement.
// Units: deg, s, duty. `update` is noexcept and allocation-free.
#pragma once

#include <cmath>
#include <concepts>
#include <string>

#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::identify {

template <class Model>
class ReanchoringObserver {
 public:
  ReanchoringObserver(const Model& model, const throttle::Anchor& anchor) : model_(model), anchor_(anchor) {
    anchor_.validate();
  }

  void start(double angle_deg, double duty = 0.0) noexcept { state_ = model_.at_rest(angle_deg, duty); }

  /// One sample: `duty` was sent at the sample before this angle. Gives measured minus predicted angle [deg]; an angle
  /// that is not finite corrects nothing.
  double update(double duty, double angle_deg) noexcept {
    model_.advance(state_, duty);
    const double innovation = angle_deg - model_.output(state_);
    if (std::isfinite(angle_deg)) model_.reanchor(state_, angle_deg, anchor_);
    return innovation;
  }
  /// Other numbers, the same state.
  void set_model(const Model& model) noexcept { model_ = model; }

  const typename Model::State& state() const noexcept { return state_; }
  const Model& model() const noexcept { return model_; }

  template <class Self, class V>
  static void visit(Self& self, V& v)
    requires std::same_as<Model, throttle::PwRModel>
  {
    v("position_deg", self.state_.position_deg);
    v("speed_deg_per_s", self.state_.speed_deg_per_s);
    v("bias_duty", self.state_.bias_duty);
    v("above", self.state_.above);
    for (std::size_t i = 0; i < self.state_.line.before.size(); ++i)
      v("before_" + std::to_string(i), self.state_.line.before[i]);
  }

 private:
  Model model_;
  throttle::Anchor anchor_;
  typename Model::State state_{};
};

}  // namespace mgdd::identify
