// A plate of the kind that the guided controller believes in, both sides of limp-home different, and what it follows.
#pragma once

#include <cmath>

#include "mgdd/control/guided_predictive.hpp"

namespace mgdd::test_support {

using namespace control;

inline GuidedPredictiveSettings asymmetric() {
  GuidedPredictiveSettings s;
  s.plate.spring = {.limp_home_deg = 11.0, .ramp_deg = 0.5, .above = {0.12, 7e-4}, .below = {0.16, 1.1e-3}};
  s.plate.friction = 0.08;
  return s;
}

/// The plain form without integral: what the model does not explain, its one bias must.
inline GuidedPredictiveSettings plain() {
  GuidedPredictiveSettings s = asymmetric();
  s.friction_learning = false;
  s.trim_rate_per_deg_s = 0.0;
  s.duty_change_weight = 20.0;
  s.move_steps = {4, 6, 10};
  return s;
}

/// A plate of the kind that the controller believes in, with steps of 0.1 ms and one sample of delay.
class Plant {
 public:
  Plant(const Plate& settings, double angle_deg) : model_(settings, 1e-4, PlateFriction::set_valued) {
    state_ = model_.at_rest(angle_deg, model_.holding(angle_deg));
    acting_ = state_.torque;
  }
  void believe(const PlateBelief<double>& belief) { model_.believe(belief); }
  double step(double duty, double disturbance = 0.0) {
    for (int i = 0; i < 10; ++i)
      model_.step(state_, acting_ + disturbance);
    acting_ = duty;
    return state_.angle_deg;
  }
  double angle_deg() const { return state_.angle_deg; }

 private:
  PlateModel<double> model_;
  PlateState<double> state_;
  double acting_;
};

template <class Controller, class Reference>
double squared_error(Controller& controller, Plant& plant, int from, int to, Reference reference) {
  double sum = 0.0;
  for (int k = from; k < to; ++k) {
    const double duty = controller.step(reference(k), plant.angle_deg());
    plant.step(duty);
    const double error = reference(k) - plant.angle_deg();
    sum += error * error;
  }
  return sum;
}

inline double driving(int k) {
  const double t = 1e-3 * k;
  const double slow = 35.0 + 22.0 * std::sin(5.0 * t) + 6.0 * std::sin(17.0 * t);
  return k % 400 < 200 ? slow : 5.0 + 3.5 * std::sin(11.0 * t);
}

}  // namespace mgdd::test_support
