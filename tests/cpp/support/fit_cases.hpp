// Small problems with known answers for the tests of least squares.
#pragma once

#include <initializer_list>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::optimize {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

inline constexpr double infinity = std::numeric_limits<double>::infinity();

inline VectorXd vector(std::initializer_list<double> values) {
  return Eigen::Map<const VectorXd>(values.begin(), static_cast<Index>(values.size()));
}

inline std::vector<Parameter> named(Index n) {
  std::vector<Parameter> parameters;
  for (Index i = 0; i < n; ++i) {
    parameters.push_back({.name = "p" + std::to_string(i)});
  }
  return parameters;
}

inline MatrixXd random_matrix(std::uint64_t seed, Index rows, Index columns) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  MatrixXd m(rows, columns);
  for (Index j = 0; j < columns; ++j) {
    for (Index i = 0; i < rows; ++i) {
      m(i, j) = normal(generator);
    }
  }
  return m;
}

struct Linear {
  MatrixXd a;
  VectorXd b;
  bool operator()(const VectorXd& x, VectorXd& r, MatrixXd* j) const {
    r.noalias() = a * x;
    r -= b;
    if (j != nullptr) {
      *j = a;
    }
    return true;
  }
};

inline bool rosenbrock(const VectorXd& x, VectorXd& r, MatrixXd* j) {
  r << 10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0];
  if (j != nullptr) {
    *j << -20.0 * x[0], 10.0, -1.0, 0.0;
  }
  return true;
}

inline FitReport fit_linear(const MatrixXd& a, const VectorXd& b) {
  return LeastSquares(named(a.cols()), a.rows()).solve(Linear{a, b}, VectorXd::Zero(a.cols()));
}

}  // namespace mgdd::optimize
