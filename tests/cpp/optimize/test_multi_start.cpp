// Fits beside their search: many starts, bounds, and what the data do not tell.
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/optimize/least_squares/multi_start.hpp"
#include "support/fit_cases.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

TEST(SpreadStarts, HasOnePointPerCellOfEveryAxis) {
  const std::vector<Parameter> box{{"a", -1.0, 3.0}, {"b", 1e-3, 10.0, true}};
  const auto points = spread_starts(box, 16, 5);
  std::array<int, 16> a{}, b{};
  for (const Eigen::VectorXd& point : points) {
    ++a[static_cast<std::size_t>(16.0 * (point[0] + 1.0) / 4.0)];
    ++b[static_cast<std::size_t>(16.0 * std::log(point[1] / 1e-3) / std::log(1e4))];
  }
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(a[i], 1);
    EXPECT_EQ(b[i], 1);
  }
  EXPECT_EQ(spread_starts(box, 16, 5)[3], points[3]);
  EXPECT_NE(spread_starts(box, 16, 6)[3], points[3]);
  EXPECT_THROW((void)spread_starts({{"a"}}, 4, 1), ParameterError);
}

FitReport with_cost(double cost, double rmse) {
  FitReport report;
  report.cost = cost;
  report.rmse = rmse;
  return report;
}

TEST(Rank, TakesTheLowestCostAndCountsWhoReachedIt) {
  const MultiStartFit fit =
      rank({with_cost(9.0, 3.0), with_cost(4.0, 2.0), with_cost(4.03, 2.0099), with_cost(4.1, 2.0101)});
  EXPECT_EQ(fit.best, 1U);
  EXPECT_EQ(fit.n_reached, 2U);
  EXPECT_EQ(fit.reports.size(), 4U);
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::nan("");
  EXPECT_EQ(rank({with_cost(nan, nan), with_cost(5.0, 1.0)}).best, 1U);
  EXPECT_EQ(rank({with_cost(infinity, infinity), with_cost(5.0, 1.0), with_cost(nan, nan)}).best, 1U);
  EXPECT_EQ(rank({with_cost(5.0, 1.0), with_cost(5.0, 1.0)}).best, 0U) << "the first of equals";
}

TEST(MultiStart, KeepsTheOrderOfItsStartsOnAnyNumberOfThreads) {
  std::vector<Eigen::VectorXd> starts;
  for (int i = 0; i < 12; ++i)
    starts.push_back(Eigen::VectorXd::Constant(1, 20.0 - i));
  for (const std::size_t threads : {1U, 3U}) {
    const MultiStartFit fit =
        multi_start(starts, [](const Eigen::VectorXd& start) { return with_cost(start[0], start[0]); }, threads);
    ASSERT_EQ(fit.reports.size(), 12U);
    for (std::size_t i = 0; i < 12; ++i)
      EXPECT_EQ(fit.reports[i].cost, 20.0 - static_cast<double>(i));
    EXPECT_EQ(fit.best, 11U);
  }
}

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

TEST(LeastSquares, SeveralNullDirectionsAreToldApart) {
  MatrixXd a = random_matrix(17, 25, 5);
  a.col(1).setZero();
  a.col(4) = 3.0 * a.col(0);
  const FitReport fit = fit_linear(a, random_matrix(18, 25, 1));
  EXPECT_EQ(fit.unidentifiable, (std::vector<std::string>{"p0", "p1", "p4"}));
  ASSERT_EQ(fit.null_directions.cols(), 2);
  EXPECT_LT((a * fit.null_directions).norm(), 1e-12);
  ASSERT_EQ(fit.findings.size(), 2u);
  const std::string both = fit.findings[0] + "; " + fit.findings[1];
  EXPECT_NE(both.find("p1: the residual does not depend on it"), std::string::npos) << both;
  EXPECT_NE(both.find("(p0 +1, p4 -0.3333)"), std::string::npos) << both;
}

TEST(FitReport, StatusesHaveNamesAndOnlyThreeAreSuccess) {
  int successes = 0;
  for (const FitStatus status :
       {FitStatus::not_run, FitStatus::cost_converged, FitStatus::step_converged, FitStatus::gradient_converged,
        FitStatus::iteration_limit, FitStatus::evaluation_failed, FitStatus::stalled}) {
    EXPECT_NE(name_of(status), "unknown");
    EXPECT_NE(explain(status), "unknown");
    successes += is_converged(status) ? 1 : 0;
  }
  EXPECT_EQ(successes, 3);
}

TEST(FitReport, UncertaintyOfAPlainJacobian) {
  const MatrixXd a = random_matrix(1, 30, 4);
  const VectorXd b = random_matrix(2, 30, 1);
  FitReport fit = fit_linear(a, b);
  const MatrixXd covariance = fit.covariance;
  describe_uncertainty(fit, a, VectorXd::Ones(4), {});
  EXPECT_LT((fit.covariance - covariance).norm(), 1e-13);
  const VectorXd units = vector({1e-9, 1.0, 1e3, 1e9});
  describe_uncertainty(fit, a * units.asDiagonal(), VectorXd::Ones(4), {});
  EXPECT_LT((units.asDiagonal() * fit.covariance * units.asDiagonal() - covariance).norm(), 1e-12);
  EXPECT_THROW(describe_uncertainty(fit, a.leftCols(3), VectorXd::Ones(4), {}), ShapeError);
}

}  // namespace
}  // namespace mgdd::optimize
