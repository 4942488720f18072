#include "support/fit_cases.hpp"

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::optimize {
namespace {

TEST(LeastSquares, ColumnsFrom1em8To1e8GiveTheSolutionOfTheUnscaledProblem) {
  const MatrixXd a = random_matrix(3, 700, 5);  // several row blocks
  const VectorXd b = random_matrix(4, 700, 1);
  const VectorXd units = vector({1e-8, 1e-4, 1.0, 1e4, 1e8});
  const FitReport plain = fit_linear(a, b);
  const FitReport scaled = fit_linear(a * units.asDiagonal(), b);
  EXPECT_TRUE(scaled.success()) << scaled.brief();
  EXPECT_LT((scaled.values.cwiseProduct(units) - plain.values).norm(), 1e-9);
  EXPECT_LT((scaled.standard_error.cwiseProduct(units) - plain.standard_error).norm(), 1e-12);
  EXPECT_LT((scaled.correlation - plain.correlation).norm(), 1e-10);
  EXPECT_EQ(scaled.iterations, plain.iterations);
}

TEST(LeastSquares, NearlyCollinearColumnsKeepSixDigits) {
  MatrixXd a = random_matrix(5, 40, 3);
  a.col(2) = a.col(0) + 1e-7 * a.col(2);  // normal equations would lose 14 digits
  const VectorXd truth = vector({1.0, -2.0, 3.0});
  const FitReport fit = fit_linear(a, a * truth);
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_LT((fit.values - truth).norm(), 1e-6);
}

// Singular Jacobian at the solution: convergence is linear, the digits of x are half those of r.
TEST(LeastSquares, PowellSingular) {
  const auto powell = [](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    const double s5 = std::sqrt(5.0), s10 = std::sqrt(10.0);
    const double u = x[1] - 2.0 * x[2], v = x[0] - x[3];
    r << x[0] + 10.0 * x[1], s5 * (x[2] - x[3]), u * u, s10 * v * v;
    if (j != nullptr) {
      *j << 1.0, 10.0, 0.0, 0.0, 0.0, 0.0, s5, -s5, 0.0, 2.0 * u, -4.0 * u, 0.0, 2.0 * s10 * v, 0.0, 0.0,
          -2.0 * s10 * v;
    }
    return true;
  };
  const FitReport fit = LeastSquares(named(4), 4).solve(powell, vector({3.0, -1.0, 0.0, 1.0}));
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_LT(fit.values.norm(), 1e-7);
  EXPECT_LT(fit.cost, 1e-28);
}

TEST(LeastSquares, ReportBeforeTheRunSaysSo) {
  const FitReport empty;
  EXPECT_EQ(empty.status, FitStatus::not_run);
  EXPECT_TRUE(std::isnan(empty.cost) && std::isnan(empty.rmse));
  EXPECT_FALSE(empty.success());
  LeastSquares solver(named(2), 2);
  solver.prepare(vector({-1.2, 1.0}));
  const FitReport prepared = solver.report();
  EXPECT_EQ(prepared.status, FitStatus::not_run);
  EXPECT_TRUE(std::isnan(prepared.cost) && prepared.covariance.array().isNaN().all());
  EXPECT_EQ(prepared.nfev, 0);
  EXPECT_FALSE(LeastSquares(named(2), 2).iterate(rosenbrock)) << "nothing was prepared";
}

TEST(LeastSquares, WrongJacobianStallsAndSaysSo) {
  const auto wrong = [](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    rosenbrock(x, r, j);
    if (j != nullptr) {
      *j *= -1.0;
    }
    return true;
  };
  const FitReport fit = LeastSquares(named(2), 2).solve(wrong, vector({-1.2, 1.0}));
  EXPECT_EQ(fit.status, FitStatus::stalled);
  EXPECT_FALSE(fit.success());
}

TEST(LeastSquares, ZeroResidualProblemEnds) {
  const MatrixXd a = random_matrix(15, 12, 3);
  const VectorXd truth = vector({1.0, 2.0, 3.0});
  const FitReport fit = fit_linear(a, a * truth);
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_LT((fit.values - truth).norm(), 1e-12);
  EXPECT_LT(fit.standard_error.maxCoeff(), 1e-11);
  const FitReport at_solution = LeastSquares(named(3), 12).solve(Linear{a, VectorXd::Zero(12)}, VectorXd::Zero(3));
  EXPECT_TRUE(at_solution.success());
  EXPECT_EQ(at_solution.iterations, 0);
}

TEST(LeastSquares, AsManyResidualsAsParametersLeavesTheStderrUndefined) {
  const FitReport fit = LeastSquares(named(2), 2).solve(rosenbrock, vector({-1.2, 1.0}));
  EXPECT_TRUE(fit.standard_error.array().isNaN().all());
  EXPECT_TRUE(std::isfinite(fit.correlation(0, 1)));
}

TEST(LeastSquares, SeparateJacobianCallsGiveTheSamePathWithFewerJacobians) {
  LeastSquaresOptions separate;
  separate.evaluate_together = false;
  const FitReport one = LeastSquares(named(2), 2).solve(rosenbrock, vector({-1.2, 1.0}));
  const FitReport two = LeastSquares(named(2), 2, separate).solve(rosenbrock, vector({-1.2, 1.0}));
  EXPECT_EQ(one.values, two.values);
  EXPECT_EQ(one.nfev, two.nfev);
  EXPECT_LT(two.njev, one.njev) << "Rosenbrock refuses some steps";
}

TEST(LeastSquares, LoopDoesNotAllocate) {
  std::vector<Parameter> parameters = named(3);
  parameters[0].upper = 0.5;
  parameters[1] = {"p1", 1e-3, 1e3, true};
  const MatrixXd a = random_matrix(16, 20000, 3);
  const VectorXd target = a * vector({1.0, 2.0, 3.0});
  const auto model = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    if (x[2] > 2.999 && x[2] < 2.9991) {
      return false;
    }
    r.noalias() = a * x;
    r -= target;
    if (j != nullptr) {
      *j = a;
    }
    return true;
  };
  for (const bool together : {true, false}) {
    LeastSquaresOptions options;
    options.evaluate_together = together;
    LeastSquares solver(parameters, 20000, options);
    solver.prepare(vector({0.0, 500.0, 0.0}));
    const test_support::AllocationCounter counter;
    while (solver.iterate(model)) {
    }
    EXPECT_EQ(counter.count(), 0u);
    const FitReport fit = solver.report();
    EXPECT_TRUE(fit.success()) << fit.brief();
    EXPECT_GT(fit.iterations, 3);
    EXPECT_GT(counter.count(), 0u) << "the report allocates, so the counter counts";
  }
}

TEST(NoAlloc, CounterSeesNewMallocAndEigen) {
  const test_support::AllocationCounter counter;
  void* block = ::operator new(16);
  const std::size_t after_new = counter.count();
  ::operator delete(block);
  const VectorXd v = VectorXd::Zero(100);
  EXPECT_GE(after_new, 1u);
  EXPECT_GT(counter.count(), after_new) << v.size();
}

TEST(LeastSquares, ARefusedCallChangesNothing) {
  std::vector<Parameter> parameters = named(2);
  parameters[0].lower = -2.0;
  LeastSquares solver(parameters, 2);
  const VectorXd start = vector({-1.2, 1.0});
  const FitReport before = solver.solve(rosenbrock, start);
  EXPECT_THROW(solver.prepare(vector({-3.0, 1.0})), ParameterError);
  EXPECT_THROW(solver.prepare(vector({std::nan(""), 1.0})), ParameterError);
  EXPECT_THROW(solver.prepare(vector({1.0})), ShapeError);
  const FitReport kept = solver.report();
  EXPECT_EQ(kept.values, before.values);
  EXPECT_EQ(kept.status, before.status);
  const auto resizes = [](const VectorXd&, VectorXd& r, MatrixXd*) {
    r.resize(7);
    return true;
  };
  EXPECT_THROW((void)solver.solve(resizes, start), ShapeError);
  const FitReport after = solver.solve(rosenbrock, start);
  EXPECT_EQ(after.values, before.values);
  EXPECT_EQ(after.iterations, before.iterations);
}

// Facts any Levenberg-Marquardt must show, with stop constants of 1e-12 and a damping that starts at 1e-2.
LeastSquaresOptions tight() {
  LeastSquaresOptions options;
  options.cost_tolerance = options.step_tolerance = options.gradient_tolerance = 1e-12;
  options.initial_damping = 1e-2;
  return options;
}

TEST(LeastSquares, RosenbrockFallsBelow1em17AndTheCostNeverRises) {
  const FitReport fit = LeastSquares({{"a"}, {"b"}}, 2, tight()).solve(rosenbrock, VectorXd{{-1.2, 1.0}});
  EXPECT_LT(fit.cost, 1e-17);
  EXPECT_LE(fit.iterations, 40);
  for (std::size_t i = 1; i < fit.history.size(); ++i) {
    EXPECT_LE(fit.history[i].cost, fit.history[i - 1].cost);
    EXPECT_EQ(fit.history[i].accepted, fit.history[i].cost < fit.history[i - 1].cost);
  }
}

TEST(LeastSquares, ATrialCostThatIsNotFiniteIsARejectedStep) {
  int calls = 0;
  const auto model = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    rosenbrock(x, r, j);
    ++calls;
    if (calls == 2 || calls == 3) r[0] = std::nan("");
    return true;
  };
  const FitReport fit = LeastSquares({{"a"}, {"b"}}, 2, tight()).solve(model, VectorXd{{-1.2, 1.0}});
  EXPECT_FALSE(fit.history[1].accepted);
  EXPECT_FALSE(fit.history[2].accepted);
  EXPECT_GT(fit.history[3].damping, fit.history[1].damping);
  EXPECT_LT(fit.cost, 1e-17);
}

TEST(LeastSquares, AskAndTellIsTheSameSearch) {
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
