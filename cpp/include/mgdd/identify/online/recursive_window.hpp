// On-line update of PW-R over a sliding window: a free run of the last half second, one damped Gauss-Newton step at a
// time, with a prior that keeps what the window does not excite. Units: deg, s, duty. `update` and `iterate` are
// noexcept and allocation-free; call `iterate` from a background task.
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "mgdd/common/state.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::identify {

struct WindowPwRSettings {
  throttle::PwR model{};                                   ///< start and prior mean; delay and sample time of the calls
  int every = 5;                                           ///< samples per point of the window: 5 ms
  double noise_deg = 0.03;                                 ///< sigma of the sensor
  double prior_spread = 0.2;                               ///< sigma of the prior as a share of each parameter
  std::array<bool, 5> free{true, true, true, true, true};  ///< tau, G, beta, kappa, delta; both sides alike

  void validate() const;
};

class WindowPwR {
 public:
  static constexpr int points = 100;  ///< 0.5 s at 5 ms

  explicit WindowPwR(const WindowPwRSettings& settings);

  /// One sample: the angle measured now and the duty sent now; NaN for what was dropped. True when a point was
  /// added.
  bool update(double duty, double angle_deg) noexcept;
  /// One Levenberg-Marquardt step on the full window. False when there is none yet, when more than half of its angles
  /// were dropped, or when the step was refused.
  bool iterate() noexcept;

  throttle::PwR model() const noexcept;
  double cost() const noexcept { return cost_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("factors", self.factors_);
    v("duty", self.duty_);
    v("angle_deg", self.angle_);
    v("known", self.known_);
    v("held_duty", self.last_duty_);
    v("duty_sum", self.duty_sum_);
    v("damping", self.damping_);
    v("cost", self.cost_);
    v("count", self.count_, counts_end);
    for (std::size_t i = 0; i < self.line_.before.size(); ++i)
      v("before_" + std::to_string(i), self.line_.before[i]);
  }

 private:
  static constexpr int unknowns = 7;  // five parameters as logarithmic factors, position and speed at the first point
  using Column = Eigen::Matrix<double, unknowns, 1>;
  using Square = Eigen::Matrix<double, unknowns, unknowns>;

  template <class T>
  throttle::BasicPwR<T> seeded(const Column& z) const noexcept;
  double evaluate(const Column& z, Square* normal, Column* gradient) const noexcept;

  WindowPwRSettings settings_;
  Eigen::Matrix<double, 5, 1> factors_ = Eigen::Matrix<double, 5, 1>::Zero();
  Eigen::Matrix<double, points, 1> duty_ = Eigen::Matrix<double, points, 1>::Zero();   // acts from a point to the next
  Eigen::Matrix<double, points, 1> angle_ = Eigen::Matrix<double, points, 1>::Zero();  // ring, oldest at count_
  Eigen::Matrix<double, points, 1> known_ = Eigen::Matrix<double, points, 1>::Zero();  // 1, or 0 for a dropped angle
  throttle::DutyLine<double> line_;
  double last_duty_ = 0.0;
  double duty_sum_ = 0.0;
  double damping_ = 1e-2;
  double cost_ = 0.0;
  std::int64_t count_ = 0;  // samples taken
};

}  // namespace mgdd::identify
