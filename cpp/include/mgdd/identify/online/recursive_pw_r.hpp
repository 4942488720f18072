// On-line update of PW-R by recursive least squares on the form that is linear in the parameters. Units: deg, s, duty.
// `update` is noexcept and allocation-free. The regression form for a held input is ours.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/least_squares/recursive_least_squares.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::identify {

/// What an update did, or why it changed nothing.
enum class UpdateGate {
  updated,
  filling,     ///< between two differences, or not enough samples yet
  slow,        ///< |w| below the gate, or a reversal inside the difference
  at_stop,     ///< at or next to an end stop
  limp_home,   ///< within the band around limp-home, where the side is not certain
  small,       ///< the error is inside the noise
  not_finite,  ///< duty or angle is not a number
};

struct RecursivePwRSettings {
  throttle::PwR model{};  ///< start, delay and sample time of the calls; bounds are those of `throttle::fields`
  int every = 5;          ///< samples per difference: 5 to 10 ms, at 1 ms the second difference is all noise
  double least_speed_deg_per_s = 20.0;
  double stop_band_deg = 1.0;
  double limp_home_band_deg = 1.0;
  double noise_deg = 0.03;  ///< sigma of the sensor
  double error_gate = 3.0;  ///< sigmas of the sensor that an error must exceed
  double forgetting = 0.998;
  double trace_cap = 1.0;                                     ///< of the covariance, relative to the start
  std::array<bool, 5> free{false, true, true, false, false};  ///< tau, G, beta, kappa, delta

  void validate() const;
};

/// With a = exp(-T/tau), the mean duty u of a difference, s = S and f = sgn(w), over two equal differences:
///   x(k+1) - 2 x(k) + x(k-1) = -p1 (x(k) - x(k-1)) + G c(u) - p3 c(S) - p4 c(x) - p5 c(f),
///   c(v) = tau (T - tau (1-a)) v(k) + tau (tau (1-a) - a T) v(k-1), p1 = 1-a, p3 = G beta, p4 = G kappa, p5 = G delta.
/// Exact for a held duty, where the implicit form of the model's own step would be 10 % off in G at T = 5 ms.
/// Held parameters stand on the other side of the equation, p4 and p5 as they are: they are torques over the inertia.
/// What drifts in service, supply and winding resistance, moves G alone, so that beta, kappa and delta all fall where
/// G rises; held in duty they would put 18 % of error into G after a supply step of 20 %.
class RecursivePwR {
 public:
  using Core = optimize::RecursiveLeastSquares<5>;

  explicit RecursivePwR(const RecursivePwRSettings& settings);

  /// One sample: the angle measured now and the duty that is sent now. Call it for a dropped sample too, with NaN: time
  /// goes on, and no difference that the sample touches is learned from.
  UpdateGate update(double duty, double angle_deg) noexcept;

  /// The model with the present numbers, inside the bounds.
  throttle::PwR model() const noexcept;
  const RecursivePwRSettings& settings() const noexcept { return settings_; }
  std::int64_t updates() const noexcept { return above_.updates() + below_.updates(); }
  const Core& above() const noexcept { return above_; }
  void require_usable() const {
    above_.require_usable();
    below_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("count", self.count_, counts_end);
    v("clean_from", self.clean_from_, counts_end);
    v("position_deg", self.position_);
    v("duty_sum", self.duty_sum_);
    v("duty_mean", self.duty_mean_);
    for (std::size_t i = 0; i < self.line_.before.size(); ++i)
      v("before_" + std::to_string(i), self.line_.before[i]);
    Prefixed<V> above{v, "above_"};
    Core::visit(self.above_, above);
    Prefixed<V> below{v, "below_"};
    Core::visit(self.below_, below);
  }

 private:
  UpdateGate learn() noexcept;

  RecursivePwRSettings settings_;
  Core above_, below_;
  throttle::DutyLine<double> line_;
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero();   // x(k-1), x(k), x(k+1), from limp-home
  Eigen::Vector2d duty_mean_ = Eigen::Vector2d::Zero();  // over the difference before and the present one
  double duty_sum_ = 0.0;
  std::int64_t count_ = 0;       // samples taken
  std::int64_t clean_from_ = 0;  // from this sample on every angle that counts and every acting duty is known
};

}  // namespace mgdd::identify
