#include "systems/wiener_hammerstein.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"

namespace mgdd::systems {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const WienerHammerstein model{.first_order = 1, .last_order = 2, .n_curve = 7, .lower = -1.5, .upper = 1.5};

VectorXd truth() {
  VectorXd x(model.n_parameters());
  x << -0.6, 0.1, -1.1, 0.4, 0.05, 0.1, -2.0, -1.3, -0.9, 0.1, 0.5, 0.6, 0.65;
  return x;
}

VectorXd signal(Eigen::Index n) {
  VectorXd u(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto t = static_cast<double>(k);
    u[k] = std::sin(0.11 * t) + 0.6 * std::sin(0.37 * t + 1.0) + 0.4 * std::cos(0.83 * t);
  }
  return u;
}

TEST(WienerHammerstein, FilterFollowsItsDifferenceEquation) {
  const VectorXd u = signal(50);
  const VectorXd y = filter_series(Eigen::Vector2d(0.5, 0.25), Eigen::Vector3d(1.0, -0.9, 0.3), u);
  for (Eigen::Index k = 2; k < 50; ++k)
    EXPECT_NEAR(y[k], 0.9 * y[k - 1] - 0.3 * y[k - 2] + 0.5 * u[k] + 0.25 * u[k - 1], 1e-12);
  EXPECT_THROW((void)filter_series(Eigen::Vector2d(1.0, 0.0), Eigen::Vector2d(2.0, 0.5), u), ParameterError);
}

TEST(WienerHammerstein, StabilityIsThatOfTheRoots) {
  EXPECT_TRUE(is_stable(Eigen::Vector3d(1.0, -1.98 * std::cos(0.3), 0.99 * 0.99)));
  EXPECT_FALSE(is_stable(Eigen::Vector3d(1.0, -2.02 * std::cos(0.3), 1.01 * 1.01)));
  EXPECT_FALSE(is_stable(Eigen::Vector3d(1.0, -2.5, 1.0)));  // roots 2 and 0.5
}

TEST(WienerHammerstein, AConstantPassesTheFiltersUnchanged) {
  const VectorXd level = VectorXd::Constant(400, 0.7);
  const VectorXd y = model.simulate(truth(), level);
  EXPECT_NEAR(y[399], model.curve(truth(), VectorXd::Constant(1, 0.7))[0], 1e-9);
}

TEST(WienerHammerstein, JacobianIsThatOfDifferences) {
  const VectorXd u = signal(300);
  const VectorXd y = VectorXd::Zero(300);
  WienerHammersteinResidual residual(model, u, y, 20);
  const VectorXd x = truth();
  VectorXd r(280);
  VectorXd up(280);
  VectorXd down(280);
  MatrixXd jacobian(280, x.size());
  ASSERT_TRUE(residual(x, r, &jacobian));
  EXPECT_NEAR((r - model.simulate(x, u).tail(280)).norm(), 0.0, 1e-12);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    VectorXd moved = x;
    moved[i] += 1e-6;
    ASSERT_TRUE(residual(moved, up, nullptr));
    moved[i] -= 2e-6;
    ASSERT_TRUE(residual(moved, down, nullptr));
    EXPECT_LT((jacobian.col(i) - (up - down) / 2e-6).norm(), 1e-6 * (1.0 + jacobian.col(i).norm()))
        << model.names()[static_cast<std::size_t>(i)];
  }
}

}  // namespace
}  // namespace mgdd::systems
