// Facts any Levenberg-Marquardt must show, with stop constants of 1e-12 and a damping that starts at 1e-2.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"
#include "support/reference_algebra.hpp"

namespace mgdd::optimize {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LeastSquaresOptions tight() {
  LeastSquaresOptions options;
  options.cost_tolerance = options.step_tolerance = options.gradient_tolerance = 1e-12;
  options.initial_damping = 1e-2;
  return options;
}

bool rosenbrock(const VectorXd& x, VectorXd& residual, MatrixXd* jacobian) {
  residual << 10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0];
  if (jacobian != nullptr) *jacobian << -20.0 * x[0], 10.0, -1.0, 0.0;
  return true;
}

TEST(LeastSquaresFacts, ALinearProblemIsSolvedTo1em8InFourSteps) {
  MatrixXd a(40, 3);
  VectorXd b(40);
  for (Eigen::Index i = 0; i < 40; ++i) {
    const auto k = static_cast<std::uint64_t>(i);
    a.row(i) << 1.0, random::normal(1, 0, k), random::normal(1, 1, k);
    b[i] = random::normal(1, 2, k);
  }
  const auto model = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    r = a * x - b;
    if (j != nullptr) *j = a;
    return true;
  };
  auto options = tight();
  options.max_iterations = 6;
  LeastSquares search({{"a"}, {"b"}, {"c"}}, 40, options);
  search.prepare(VectorXd::Constant(3, 5.0));
  search.iterate(model);
  // Every step shrinks the error by the damping, which falls to a third: 1e-2, 3e-3, 1e-3, 4e-4.
  for (int step = 0; step < 4; ++step)
    search.iterate(model);
  const VectorXd exact = test_support::solved(test_support::gram(a), test_support::product(a.transpose(), b));
  EXPECT_LT((search.report().values - exact).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(LeastSquaresFacts, RosenbrockFallsBelow1em17AndTheCostNeverRises) {
  const FitReport fit = LeastSquares({{"a"}, {"b"}}, 2, tight()).solve(rosenbrock, VectorXd{{-1.2, 1.0}});
  EXPECT_LT(fit.cost, 1e-17);
  EXPECT_LE(fit.iterations, 40);
  for (std::size_t i = 1; i < fit.history.size(); ++i) {
    EXPECT_LE(fit.history[i].cost, fit.history[i - 1].cost);
    EXPECT_EQ(fit.history[i].accepted, fit.history[i].cost < fit.history[i - 1].cost);
  }
}

TEST(LeastSquaresFacts, ATrialCostThatIsNotFiniteIsARejectedStep) {
  int calls = 0;
  const auto model = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    rosenbrock(x, r, j);
    ++calls;
    if (calls == 2 || calls == 3) r[0] = std::numeric_limits<double>::quiet_NaN();
    return true;
  };
  const FitReport fit = LeastSquares({{"a"}, {"b"}}, 2, tight()).solve(model, VectorXd{{-1.2, 1.0}});
  EXPECT_FALSE(fit.history[1].accepted);
  EXPECT_FALSE(fit.history[2].accepted);
  EXPECT_GT(fit.history[3].damping, fit.history[1].damping);
  EXPECT_LT(fit.cost, 1e-17);
}

TEST(LeastSquaresFacts, AskAndTellIsTheSameSearch) {
  const VectorXd start{{-1.2, 1.0}};
  const FitReport expected = LeastSquares({{"a"}, {"b"}}, 2, tight()).solve(rosenbrock, start);
  LeastSquares search({{"a"}, {"b"}}, 2, tight());
  search.prepare(start);
  VectorXd residual(2);
  MatrixXd jacobian(2, 2);
  do {
    rosenbrock(search.ask(), residual, &jacobian);
  } while (search.tell(true, residual, jacobian));
  const FitReport report = search.report();
  EXPECT_EQ(report.values, expected.values);
  EXPECT_EQ(report.iterations, expected.iterations);
  EXPECT_EQ(report.nfev, expected.nfev);
}

}  // namespace
}  // namespace mgdd::optimize
