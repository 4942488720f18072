// On-line update of PW-R along the gradient of its own corrected prediction, with the adaptation gain g_r of
// Tan (2018): q <- q + g_r s e/(1 + s's), e = measured minus predicted, s = d prediction/d q, q = log of the parameter
// over its start. The law is ours. Units: deg, s, duty. noexcept, allocation-free.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <Eigen/Core>

#include "mgdd/common/bounds.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/identify/online/pw_r_factors.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::identify {

struct GradientPwRSettings {
  throttle::PwR model{};
  double adaptation_gain = 0.05;  ///< g_r, 0.01 to 0.1
  double reach = 0.7;             ///< largest |q|: a factor of two either way
  double least_error_deg = 0.09;  ///< 3 sigma of the sensor
  throttle::ObserverGains gains{.angle_gain = 0.05, .speed_gain_per_s = 2.0, .bias_gain_duty_per_deg = 0.0};
  std::array<bool, 5> free{false, true, true, false, false};  ///< tau, G, beta, kappa, delta; both sides alike

  void validate() const {
    model.validate();
    gains.validate();
    require_within("adaptation_gain", adaptation_gain, 1e-6, 1.0);
    require_within("reach", reach, 0.01, 3.0);
    require_within("least_error_deg", least_error_deg, 0.0, 10.0, "deg");
  }
};

class GradientPwR {
 public:
  explicit GradientPwR(const GradientPwRSettings& settings) : settings_(settings) { settings_.validate(); }

  void start(double angle_deg, double duty = 0.0) noexcept {
    state_ = throttle::model_of(seeded<Scalar>(), throttle::unchecked).at_rest(Scalar(angle_deg), Scalar(duty));
    last_duty_ = duty;
  }

  /// One sample: `duty` was sent at the sample before this angle. Gives measured minus predicted angle [deg];
  /// 0 for a dropped sample (NaN), which moves the observer on by the last duty and teaches nothing.
  double update(double duty, double angle_deg) noexcept {
    const bool has_duty = std::isfinite(duty);
    if (has_duty) last_duty_ = duty;
    const auto model = throttle::model_of(seeded<Scalar>(), throttle::unchecked);
    model.step(state_, Scalar(last_duty_));
    if (!std::isfinite(angle_deg)) return 0.0;
    const Scalar y = model.output(state_);
    const double error = angle_deg - y.value;
    if (has_duty && std::abs(error) > settings_.least_error_deg) {
      double power = 1.0;
      for (std::size_t i = 0; i < 5; ++i)
        power += settings_.free[i] ? y.grad[i] * y.grad[i] : 0.0;
      for (std::size_t i = 0; i < 5; ++i) {
        if (!settings_.free[i]) continue;
        const double moved = factors_[static_cast<int>(i)] + settings_.adaptation_gain * y.grad[i] * error / power;
        factors_[static_cast<int>(i)] = std::clamp(moved, -settings_.reach, settings_.reach);
      }
    }
    model.correct(state_, Scalar(angle_deg), settings_.gains);
    return has_duty ? error : 0.0;
  }

  throttle::PwR model() const noexcept { return bounded(seeded<double>()); }
  const Eigen::Matrix<double, 5, 1>& factors() const noexcept { return factors_; }

  /// The sensitivities of the observer are part of the state.
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("factors", self.factors_);
    v("held_duty", self.last_duty_);
    dynamics::visit_numbers<throttle::BasicPwRModel<Scalar>>(self.state_, v);
  }

 private:
  using Scalar = Dual<5>;

  template <class T>
  throttle::BasicPwR<T> seeded() const noexcept {
    return with_factors<T>(settings_.model, factors_);
  }

  GradientPwRSettings settings_;
  Eigen::Matrix<double, 5, 1> factors_ = Eigen::Matrix<double, 5, 1>::Zero();
  throttle::BasicPwRState<Scalar> state_{};
  double last_duty_ = 0.0;
};

}  // namespace mgdd::identify
