// The quadratic program of a horizon by dense condensing, without limits: what the Riccati sweep is compared with.
#pragma once

#include <Eigen/Cholesky>
#include <cstddef>

#include "mgdd/control/horizon_qp.hpp"

namespace mgdd::bench {

/// Responses of the outputs, normal matrix, Cholesky factor, solution.
template <int N, int n>
struct Condensed {
  Eigen::Matrix<double, N, N> response = Eigen::Matrix<double, N, N>::Zero(), normal;
  Eigen::Matrix<double, N, 1> slope, input;
  Eigen::LLT<Eigen::Matrix<double, N, N>> factor;

  void solve(const control::HorizonQp<double, N, n>& qp, const Eigen::Matrix<double, n, 1>& deviation) {
    Eigen::Matrix<double, N, 1> error;
    Eigen::Matrix<double, n, 1> x = deviation;
    for (int k = 0; k < N; ++k) {
      const auto& stage = qp.stages[static_cast<std::size_t>(k)];
      x = (stage.a * x).eval();
      error(k) = stage.error + stage.c.dot(x);
      Eigen::Matrix<double, n, 1> d = stage.b;
      response(k, k) = stage.c.dot(d);
      for (int j = k + 1; j < N; ++j) {
        const auto& next = qp.stages[static_cast<std::size_t>(j)];
        d = (next.a * d).eval();
        response(j, k) = next.c.dot(d);
      }
    }
    Eigen::Matrix<double, N, 1> weight;
    for (int k = 0; k < N; ++k)
      weight(k) = qp.stages[static_cast<std::size_t>(k)].weight;
    normal.setZero();
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j <= i; ++j)
        normal(i, j) = response.col(i).tail(N - i).cwiseProduct(weight.tail(N - i)).dot(response.col(j).tail(N - i));
    }
    normal.diagonal().array() += qp.input_weight;
    slope.noalias() = response.transpose() * weight.cwiseProduct(error);
    for (int k = 0; k < N; ++k)
      slope(k) += qp.input_weight * qp.nominal[static_cast<std::size_t>(k)];
    factor.compute(normal);
    input = -factor.solve(slope);
  }
};

}  // namespace mgdd::bench
