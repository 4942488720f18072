#include "support/horizon_case.hpp"

#include <algorithm>

#include <Eigen/QR>

namespace mgdd::test_support {
namespace {

// The x >= 0 of least |a x - b|: Lawson and Hanson 1995, algorithm NNLS.
Eigen::VectorXd nonnegative_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  const Eigen::Index n = a.cols();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  std::vector<bool> in(static_cast<std::size_t>(n), false);
  for (int round = 0; round < 20 * static_cast<int>(n); ++round) {
    const Eigen::VectorXd pull = a.transpose() * (b - a * x);
    Eigen::Index best = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!in[static_cast<std::size_t>(i)] && pull(i) > 1e-13 * b.norm() && (best < 0 || pull(i) > pull(best)))
        best = i;
    }
    if (best < 0) break;
    in[static_cast<std::size_t>(best)] = true;
    for (;;) {
      std::vector<Eigen::Index> at;
      for (Eigen::Index i = 0; i < n; ++i) {
        if (in[static_cast<std::size_t>(i)]) at.push_back(i);
      }
      const Eigen::VectorXd z = a(Eigen::all, at).colPivHouseholderQr().solve(b);
      double share = 1.0;
      for (std::size_t i = 0; i < at.size(); ++i) {
        const Eigen::Index k = static_cast<Eigen::Index>(i);
        if (z(k) <= 0.0) share = std::min(share, x(at[i]) / (x(at[i]) - z(k)));
      }
      for (std::size_t i = 0; i < at.size(); ++i) {
        double& value = x(at[i]);
        value += share * (z(static_cast<Eigen::Index>(i)) - value);
        if (share < 1.0 && value <= 1e-15) {
          value = 0.0;
          in[static_cast<std::size_t>(at[i])] = false;
        }
      }
      if (share == 1.0) break;
    }
  }
  return x;
}

}  // namespace

DenseHorizon DenseHorizon::of(const Eigen::MatrixXd& rows, const Eigen::VectorXd& rest) {
  return {2.0 * rows.transpose() * rows, 2.0 * rows.transpose() * rest, rest.squaredNorm()};
}

double DenseHorizon::cost(const Eigen::VectorXd& u) const {
  return u.dot(hessian * u) * 0.5 + slope.dot(u) + constant;
}

double broken_optimality(const DenseHorizon& qp, const Eigen::VectorXd& u, const Limits& limits) {
  const Eigen::Index n = u.size();
  std::vector<Eigen::VectorXd> acting;
  double broken = 0.0;
  const auto meet = [&](double excess, const Eigen::VectorXd& outwards) {
    broken = std::max(broken, excess);
    if (excess > -1e-9) acting.push_back(outwards);
  };
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::VectorXd e = Eigen::VectorXd::Zero(n);
    e(k) = 1.0;
    meet(u(k) - limits.upper, e);
    meet(limits.lower - u(k), -e);
    if (k > 0) e(k - 1) = -1.0;
    const double change = u(k) - (k > 0 ? u(k - 1) : limits.before);
    meet(change - limits.largest_change, e);
    meet(-change - limits.largest_change, -e);
  }
  const Eigen::VectorXd slope = qp.hessian * u + qp.slope;
  const double scale = 1.0 + (qp.hessian.cwiseAbs() * u.cwiseAbs()).maxCoeff() + qp.slope.cwiseAbs().maxCoeff();
  if (acting.empty()) return std::max(broken, slope.cwiseAbs().maxCoeff() / scale);
  Eigen::MatrixXd a(n, static_cast<Eigen::Index>(acting.size()));
  for (std::size_t i = 0; i < acting.size(); ++i)
    a.col(static_cast<Eigen::Index>(i)) = acting[i];
  const Eigen::VectorXd left = slope + a * nonnegative_least_squares(a, -slope);
  return std::max(broken, left.cwiseAbs().maxCoeff() / scale);
}

}  // namespace mgdd::test_support
