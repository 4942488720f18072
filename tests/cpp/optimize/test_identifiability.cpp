#include "support/fit_cases.hpp"

#include <gtest/gtest.h>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"

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
