// Cholesky factors of matrices that are kept row by row, in place and without allocation. noexcept.
#pragma once

#include <algorithm>
#include <cmath>

#include "mgdd/optimize/belief/process_kernel.hpp"

namespace mgdd::optimize {

inline constexpr double jitter = 1e-10;  ///< least share of a diagonal entry that is left of it

inline double dot(const double* a, const double* b, Eigen::Index n) noexcept {
  return Eigen::Map<const Eigen::VectorXd>(a, n).dot(Eigen::Map<const Eigen::VectorXd>(b, n));
}

// The lower triangle of rows of a positive definite matrix becomes that of its Cholesky factor.
inline void cholesky(InputTable& m, Eigen::Index n) noexcept {
  for (Eigen::Index i = 0; i < n; ++i) {
    const double size = m(i, i);
    for (Eigen::Index j = 0; j < i; ++j)
      m(i, j) = (m(i, j) - dot(&m(i, 0), &m(j, 0), j)) / m(j, j);
    m(i, i) = std::sqrt(std::max(size - dot(&m(i, 0), &m(i, 0), i), jitter * size));
  }
}

inline void solve_lower(const InputTable& factor, Eigen::Index n, double* x) noexcept {
  for (Eigen::Index i = 0; i < n; ++i)
    x[i] = (x[i] - dot(&factor(i, 0), x, i)) / factor(i, i);
}

inline void solve_upper(const InputTable& factor, Eigen::Index n, double* x) noexcept {
  for (Eigen::Index i = n - 1; i >= 0; --i) {
    x[i] /= factor(i, i);
    for (Eigen::Index j = 0; j < i; ++j)
      x[j] -= factor(i, j) * x[i];
  }
}

}  // namespace mgdd::optimize
