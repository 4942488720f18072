// Problems of a receding horizon drawn at random, the same ones dense, and a plant without symmetry.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "mgdd/control/horizon_qp.hpp"
#include "mgdd/dynamics/rk4.hpp"

namespace mgdd::test_support {

/// x' = A x + B u, y = c'x: an oscillator with a lag before it, unlike in every entry.
struct LaggedOscillator {
  static constexpr int n_states = 3, n_inputs = 1, n_parameters = 1;

  template <class T, class C, class U>
  std::array<T, 3> derivative(const std::array<C, 1>& p, const std::array<T, 3>& x,
                              const std::array<U, 1>& u) const noexcept {
    return {x[1], T(-7.0) * x[0] - T(0.9) * x[1] + T(p[0]) * x[2], T(u[0]) * T(4.0) - T(3.0) * x[2]};
  }
  template <class T, class C>
  T output(const std::array<C, 1>&, const std::array<T, 3>& x) const noexcept {
    return T(1.3) * x[0] + T(0.02) * x[1];
  }
};

/// A pendulum with friction that saturates: nonlinear in state and output.
struct Pendulum {
  static constexpr int n_states = 2, n_inputs = 1, n_parameters = 1;

  template <class T, class C, class U>
  std::array<T, 2> derivative(const std::array<C, 1>& p, const std::array<T, 2>& x,
                              const std::array<U, 1>& u) const noexcept {
    using std::sin;
    return {x[1], T(-9.0) * sin(x[0]) - T(p[0]) * tanh_of(T(3.0) * x[1]) - T(0.2) * x[1] + T(6.0) * T(u[0])};
  }
  template <class T, class C>
  T output(const std::array<C, 1>&, const std::array<T, 2>& x) const noexcept {
    return x[0] + T(0.1) * x[0] * x[0];
  }
};

/// A quadratic program over the inputs of a horizon: 1/2 u'Hu + f'u under |.| limits, made without a recursion.
struct DenseHorizon {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd slope;  // at u = 0
  double constant = 0.0;

  /// |rows u + rest|^2
  static DenseHorizon of(const Eigen::MatrixXd& rows, const Eigen::VectorXd& rest);

  double cost(const Eigen::VectorXd& u) const;
};

/// The stacked least-squares problem of the stages: rows of outputs, inputs and changes.
template <int N, int n>
DenseHorizon stacked(const control::HorizonQp<double, N, n>& qp, const Eigen::Matrix<double, n, 1>& deviation,
                     double before) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3 * N, N);
  Eigen::VectorXd rest = Eigen::VectorXd::Zero(3 * N);
  for (int k = 0; k < N; ++k) {
    const auto& stage = qp.stages[static_cast<std::size_t>(k)];
    Eigen::Matrix<double, n, 1> x = deviation;
    for (int i = 0; i <= k; ++i) {
      const auto& s = qp.stages[static_cast<std::size_t>(i)];
      x = s.a * x - s.b * qp.nominal[static_cast<std::size_t>(i)];
      Eigen::Matrix<double, n, 1> to_end = s.b;
      for (int j = i + 1; j <= k; ++j)
        to_end = qp.stages[static_cast<std::size_t>(j)].a * to_end;
      rows(k, i) = std::sqrt(stage.weight) * stage.c.dot(to_end);
    }
    rest(k) = std::sqrt(stage.weight) * (stage.error + stage.c.dot(x));
    rows(N + k, k) = std::sqrt(qp.input_weight);
    rows(2 * N + k, k) = std::sqrt(qp.change_weight);
    if (k > 0) rows(2 * N + k, k - 1) = -std::sqrt(qp.change_weight);
  }
  rest(2 * N) = -std::sqrt(qp.change_weight) * before;
  return DenseHorizon::of(rows, rest);
}

struct Limits {
  double lower, upper, largest_change, before;
};

/// How far inputs are from satisfying the conditions of Karush, Kuhn and Tucker: the largest of what breaks a limit
/// and of the slope, over its scale, that no push of the acting limits takes up.
double broken_optimality(const DenseHorizon& qp, const Eigen::VectorXd& u, const Limits& limits);

/// A horizon of stages without any symmetry, each unlike the next; `spread` of the errors tells how much is limited.
template <int N, int n>
struct RandomHorizon {
  control::HorizonQp<double, N, n> qp;
  Eigen::Matrix<double, n, 1> deviation;
  Limits limits{};

  RandomHorizon(unsigned seed, double spread, bool bound_changes) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto draw = [&](double low, double high) { return low + (high - low) * 0.5 * (1.0 + uniform(random)); };
    for (auto& stage : qp.stages) {
      stage.a = stage.a.unaryExpr([&](double) { return 0.45 * uniform(random); });
      for (int i = 0; i < n; ++i)
        stage.a(i, i) += 0.6;
      stage.b = stage.b.unaryExpr([&](double) { return uniform(random); });
      stage.c = stage.c.unaryExpr([&](double) { return uniform(random); });
      stage.error = spread * uniform(random);
      stage.weight = std::pow(10.0, draw(-1.0, 2.0));
    }
    for (int i = 0; i < n; ++i)
      deviation(i) = spread * uniform(random);
    const int kind = static_cast<int>(seed % 3);
    qp.input_weight = kind == 0 ? 0.0 : std::pow(10.0, draw(-3.0, 1.0));
    qp.change_weight = kind == 1 ? 0.0 : std::pow(10.0, draw(-3.0, 1.0));
    limits = {draw(-1.3, -0.2), draw(0.1, 0.9), bound_changes ? draw(0.05, 0.6) : 1e30, 0.0};
    limits.before = draw(limits.lower, limits.upper);
    qp.set.limit(limits.lower, limits.upper, limits.largest_change);
    for (double& u : qp.nominal)
      u = draw(limits.lower, limits.upper);
    qp.set.clamp(qp.nominal, limits.before);
    qp.invalidate();
  }
  Eigen::VectorXd solution() const { return Eigen::Map<const Eigen::VectorXd>(qp.input().data(), N); }
};

}  // namespace mgdd::test_support
