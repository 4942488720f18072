#include "support/fit_cases.hpp"

#include <gtest/gtest.h>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::optimize {
namespace {

TEST(LeastSquares, ExactCollinearityIsNamedWithItsDirection) {
  MatrixXd a = random_matrix(9, 25, 4);
  a.col(2) = -2.0 * a.col(0);
  const VectorXd b = random_matrix(10, 25, 1);
  const FitReport fit = fit_linear(a, b);
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_EQ(fit.unidentifiable, (std::vector<std::string>{"p0", "p2"}));
  ASSERT_EQ(fit.null_directions.cols(), 1);
  EXPECT_LT((a * fit.null_directions.col(0)).norm(), 1e-12);
  EXPECT_NEAR(fit.null_directions(0, 0), 1.0, 1e-12);
  EXPECT_NEAR(fit.null_directions(2, 0), 0.5, 1e-12);
  EXPECT_EQ(fit.standard_error[0], infinity);
  EXPECT_EQ(fit.standard_error[2], infinity);
  EXPECT_NEAR(fit.correlation(0, 2), 1.0, 1e-9);
  // The other two are determined, with the stderr of the problem that has the column once.
  MatrixXd once(25, 3);
  once << a.col(0), a.col(1), a.col(3);
  const FitReport reduced = fit_linear(once, b);
  EXPECT_NEAR(fit.standard_error[1], reduced.standard_error[1], 1e-12);
  EXPECT_NEAR(fit.standard_error[3], reduced.standard_error[2], 1e-12);
  ASSERT_EQ(fit.findings.size(), 1u);
  EXPECT_NE(fit.findings[0].find("(p0 +1, p2 +0.5)"), std::string::npos) << fit.findings[0];
}

TEST(LeastSquares, ParameterWithoutEffectIsNamed) {
  MatrixXd a = random_matrix(11, 10, 2);
  a.col(1).setZero();
  const FitReport fit = fit_linear(a, random_matrix(12, 10, 1));
  EXPECT_EQ(fit.unidentifiable, std::vector<std::string>{"p1"});
  EXPECT_EQ(fit.standard_error[1], infinity);
  EXPECT_EQ(fit.values[1], 0.0);
  EXPECT_NE(fit.findings.at(0).find("p1: the residual does not depend on it"), std::string::npos);
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

TEST(LeastSquares, HighCorrelationIsNamedFromTheLimitOn) {
  MatrixXd a = random_matrix(13, 400, 3);
  a.col(2) = a.col(0) + 0.1 * a.col(2);  // correlation about -1 / sqrt(1.01) = -0.995
  const VectorXd b = random_matrix(14, 400, 1);
  const FitReport strict = fit_linear(a, b);
  EXPECT_LT(strict.correlation(0, 2), -0.98);
  EXPECT_EQ(strict.unidentifiable, (std::vector<std::string>{"p0", "p2"}));
  EXPECT_TRUE(std::isfinite(strict.standard_error[0]));
  LeastSquaresOptions options;
  options.correlation_limit = 0.9999;
  LeastSquares lenient(named(3), 400, options);
  EXPECT_TRUE(lenient.solve(Linear{a, b}, VectorXd::Zero(3)).unidentifiable.empty());
}

// Truth within 1.96 stderr in 95 % of 200 fits: 190 +- 3.6 standard deviations of 3.08.
TEST(LeastSquares, StderrCoversTheTruthAsOftenAsItPromises) {
  LeastSquares solver(named(2), 60);
  Decay model{VectorXd(60)};
  const VectorXd truth = vector({2.0, 0.8});
  std::array<int, 2> covered{};
  int within_three = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const VectorXd noise = random_matrix(1000 + seed, 60, 1);
    for (Index i = 0; i < 60; ++i) {
      model.y[i] = truth[0] * std::exp(-truth[1] * 0.1 * static_cast<double>(i)) + 0.05 * noise[i];
    }
    const FitReport fit = solver.solve(model, vector({1.0, 0.2}));
    ASSERT_TRUE(fit.success()) << fit.brief();
    const VectorXd z = (fit.values - truth).cwiseQuotient(fit.standard_error).cwiseAbs();
    covered[0] += z[0] < 1.96 ? 1 : 0;
    covered[1] += z[1] < 1.96 ? 1 : 0;
    within_three += z.maxCoeff() < 3.0 ? 1 : 0;
  }
  EXPECT_NEAR(covered[0], 190, 11);
  EXPECT_NEAR(covered[1], 190, 11);
  EXPECT_GE(within_three, 195);
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
