// Recursive least squares with forgetting: numbers in, numbers out. y = phi' p + noise; every update is noexcept and
// allocation-free. The estimate stays inside a box, and the trace of P inside a cap, so that a dull input neither
// drifts nor winds up. The textbook recursion with a forgetting factor; box and cap are ours.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"

namespace mgdd::optimize {

template <int N>
struct RecursiveSettings {
  using Column = Eigen::Matrix<double, N, 1>;

  Column start = Column::Zero();
  Column lower = Column::Constant(-1e300);
  Column upper = Column::Constant(1e300);
  Column start_variance = Column::Ones();  ///< diagonal of P; 0 holds that parameter
  double forgetting = 0.998;               ///< lambda, in [0.5, 1]: below, the memory is less than two equations
  double trace_cap = 1e6;                  ///< of P, relative to the scaled start: trace(P)/trace(P_0)

  void validate() const {
    require_within("forgetting", forgetting, 0.5, 1.0);
    require_within("trace_cap", trace_cap, 1.0, 1e12);
    for (int i = 0; i < N; ++i) {
      const std::string at = "[" + std::to_string(i) + "]";
      if (!(lower[i] <= upper[i])) throw ParameterError("lower" + at + " = " + text(lower[i]) + ": must be <= upper");
      require_within("start" + at, start[i], lower[i], upper[i]);
      require_within("start_variance" + at, start_variance[i], 0.0, 1e300);
    }
  }
};

template <int N>
class RecursiveLeastSquares {
 public:
  using Column = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;
  using Settings = RecursiveSettings<N>;

  explicit RecursiveLeastSquares(const Settings& settings) : settings_(settings) {
    settings_.validate();
    estimate_ = settings_.start;
    covariance_ = settings_.start_variance.asDiagonal();
  }

  /// What the next output should be for a regressor.
  double predict(const Column& phi) const noexcept { return dot(phi, estimate_); }

  /// Takes one equation. False, and nothing changed, when a number is not finite or would not stay so.
  bool update(const Column& phi, double y) noexcept {
    if (!std::isfinite(y) || !phi.allFinite()) return false;
    Column gain;
    for (int i = 0; i < N; ++i)
      gain[i] = dot(covariance_.col(i), phi);  // symmetric
    const double divisor = settings_.forgetting + dot(phi, gain);
    const double error = y - dot(phi, estimate_);
    const Column moved = estimate_ + gain * (error / divisor);
    Square left = covariance_ - gain * gain.transpose() / divisor;
    // Forget only what the cap allows, so that directions without excitation do not grow for ever.
    const double cap = settings_.trace_cap * dot(settings_.start_variance, Column::Ones());
    const double trace = dot(left.diagonal(), Column::Ones());
    double growth = 1.0 / settings_.forgetting;
    if (trace * growth > cap && trace > 0.0) growth = cap / trace > 1.0 ? cap / trace : 1.0;
    left *= growth;
    // Before the box: its comparisons would hide a NaN.
    if (!moved.allFinite() || !left.allFinite()) return false;
    estimate_ = moved.cwiseMax(settings_.lower).cwiseMin(settings_.upper);
    covariance_ = 0.5 * (left + left.transpose());
    ++updates_;
    return true;
  }

  const Column& estimate() const noexcept { return estimate_; }
  const Square& covariance() const noexcept { return covariance_; }
  std::int64_t updates() const noexcept { return updates_; }
  const Settings& settings() const noexcept { return settings_; }

  void require_usable() const {
    for (int i = 0; i < N; ++i)
      require_within("estimate[" + std::to_string(i) + "]", estimate_[i], settings_.lower[i], settings_.upper[i]);
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("estimate", self.estimate_);
    v("covariance", self.covariance_);
    v("updates", self.updates_, counts_end);
  }

 private:
  /// In one order and without fusing, whatever instruction set the caller is compiled for: Eigen's sum has neither.
  template <class A, class B>
  static double dot(const A& a, const B& b) noexcept {
    double sum = 0.0;
    for (int i = 0; i < N; ++i)
      sum += a[i] * b[i];
    return sum;
  }

  Settings settings_;
  Column estimate_;
  Square covariance_;
  std::int64_t updates_ = 0;
};

}  // namespace mgdd::optimize
