#include "support/fit_cases.hpp"

#include <gtest/gtest.h>

namespace mgdd::optimize {
namespace {

// With almost no damping one step solves a linear problem, also when it meets a bound on the way.
TEST(LeastSquares, OtherParametersAreSolvedAgainAfterAClip) {
  const MatrixXd a = random_matrix(6, 20, 3);
  std::vector<Parameter> parameters = named(3);
  parameters[0].upper = 1.0;
  LeastSquaresOptions options;
  options.initial_damping = 1e-20;
  const FitReport fit =
      LeastSquares(parameters, 20, options).solve(Linear{a, a * vector({2.0, -1.0, 0.5})}, vector({-5.0, 0.0, 0.0}));
  ASSERT_GE(fit.history.size(), 2u);
  EXPECT_NEAR(fit.history[1].cost, fit.cost, 1e-9 * fit.cost);
}

TEST(LeastSquares, StartAtAnOptimumOnTheBoundIsStationary) {
  std::vector<Parameter> parameters = named(2);
  parameters[0].lower = 0.0;
  const MatrixXd identity = MatrixXd::Identity(2, 2);
  const FitReport fit = LeastSquares(parameters, 2).solve(Linear{identity, vector({-1.0, 3.0})}, vector({0.0, 3.0}));
  EXPECT_EQ(fit.status, FitStatus::gradient_converged);
  EXPECT_EQ(fit.iterations, 0);
  EXPECT_EQ(fit.bounds_active, Eigen::Vector2i(-1, 0));
}

// exp(log(upper)) may exceed upper by a rounding: the model must never see that.
TEST(LeastSquares, LogScaledParametersStayInsideToTheLastDigit) {
  for (int i = 1; i <= 300; ++i) {
    const double upper = 0.37 * i;
    const double target = std::nextafter(upper, 0.0);
    const auto model = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
      EXPECT_LE(x[0], upper);
      r[0] = x[0] - target;
      r[1] = 1.0;
      if (j != nullptr) {
        *j << 1.0, 0.0;
      }
      return true;
    };
    EXPECT_TRUE(LeastSquares({{"p", 1e-3, upper, true}}, 2).solve(model, vector({0.7 * upper})).success());
  }
}

TEST(LeastSquares, LeavesABoundWhoseDescentPointsInward) {
  std::vector<Parameter> parameters = named(2);
  parameters[0].lower = parameters[1].lower = 0.0;
  const FitReport fit = LeastSquares(parameters, 2).solve(rosenbrock, vector({0.0, 0.0}));
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_LT((fit.values - vector({1.0, 1.0})).norm(), 1e-9);
}

TEST(LeastSquares, EveryEvaluationStaysInTheBox) {
  std::vector<Parameter> parameters = named(2);
  parameters[0] = {"p0", -1.5, 0.5};
  parameters[1] = {"p1", 1e-3, 2.0, true};
  const auto watched = [](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    EXPECT_TRUE(x[0] >= -1.5 && x[0] <= 0.5 && x[1] >= 1e-3 && x[1] <= 2.0) << x.transpose();
    return rosenbrock(x, r, j);
  };
  const FitReport fit = LeastSquares(parameters, 2).solve(watched, vector({-1.2, 1.0}));
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_NEAR(fit.values[1], 0.25, 1e-9);
}

}  // namespace
}  // namespace mgdd::optimize
