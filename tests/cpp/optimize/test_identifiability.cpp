#include "support/fit_cases.hpp"

#include <gtest/gtest.h>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::optimize {
namespace {

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
