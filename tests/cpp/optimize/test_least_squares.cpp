#include "support/fit_cases.hpp"

#include <array>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"
#include "support/reference_algebra.hpp"

namespace mgdd::optimize {
namespace {

TEST(LeastSquares, LinearProblemReachesTheNormalEquationsAndTheirCovariance) {
  const MatrixXd a = random_matrix(1, 30, 4);
  const VectorXd b = random_matrix(2, 30, 1);
  const FitReport fit = fit_linear(a, b);
  const MatrixXd inverse = test_support::inverse(test_support::gram(a));
  const VectorXd expected = test_support::product(inverse, test_support::product(a.transpose(), b));
  const double variance = (a * expected - b).squaredNorm() / (30 - 4);
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_LT((fit.values - expected).norm(), 1e-9);
  EXPECT_LT((fit.covariance - variance * inverse).norm(), 1e-12 * fit.covariance.norm() + 1e-13);
  EXPECT_LT((fit.standard_error - (variance * inverse).diagonal().cwiseSqrt()).norm(), 1e-12);
  EXPECT_NEAR(fit.correlation(0, 1), inverse(0, 1) / std::sqrt(inverse(0, 0) * inverse(1, 1)), 1e-12);
  EXPECT_NEAR(fit.rmse, std::sqrt((a * expected - b).squaredNorm() / 30), 1e-12);
  EXPECT_NEAR(fit.cost, 0.5 * (a * expected - b).squaredNorm(), 1e-12);
  EXPECT_TRUE(fit.unidentifiable.empty());
}

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

TEST(LeastSquares, RosenbrockFromTheStandardStart) {
  const FitReport fit = LeastSquares(named(2), 2).solve(rosenbrock, vector({-1.2, 1.0}));
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_LT((fit.values - vector({1.0, 1.0})).norm(), 1e-9);
  EXPECT_LT(fit.iterations, 40);
  for (std::size_t i = 1; i < fit.history.size(); ++i) {
    EXPECT_LE(fit.history[i].cost, fit.history[i - 1].cost);
    EXPECT_EQ(fit.history[i].accepted, fit.history[i].cost < fit.history[i - 1].cost);
  }
  EXPECT_EQ(fit.history.size(), static_cast<std::size_t>(fit.iterations) + 1);
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

TEST(LeastSquares, LogScalingFindsOrdersOfMagnitudeAndReportsNaturalUnits) {
  VectorXd y(40);
  VectorXd noise = random_matrix(8, 40, 1);
  for (Index i = 0; i < 40; ++i) {
    y[i] = 3e-6 * std::exp(-1.7 * 0.1 * static_cast<double>(i)) + 1e-8 * noise[i];
  }
  const std::vector<Parameter> log_scaled{{"a", 1e-12, 1e6, true}, {"rate", 1e-6, 1e6, true}};
  const FitReport in_log = LeastSquares(log_scaled, 40).solve(Decay{y}, vector({1.0, 1e-3}));
  const FitReport natural = LeastSquares(named(2), 40).solve(Decay{y}, vector({2.9e-6, 1.6}));
  EXPECT_TRUE(in_log.success()) << in_log.brief();
  EXPECT_LT((in_log.values - natural.values).cwiseQuotient(natural.values).norm(), 1e-6);
  EXPECT_LT((in_log.standard_error - natural.standard_error).cwiseQuotient(natural.standard_error).norm(), 1e-6);
  EXPECT_NEAR(in_log.values[1], 1.7, 4 * in_log.standard_error[1]);
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

TEST(LeastSquares, IterationLimitAndStoppedByTheCaller) {
  LeastSquaresOptions options;
  options.max_iterations = 3;
  LeastSquares solver(named(2), 2, options);
  const FitReport fit = solver.solve(rosenbrock, vector({-1.2, 1.0}));
  EXPECT_EQ(fit.status, FitStatus::iteration_limit);
  EXPECT_EQ(fit.iterations, 3);
  EXPECT_EQ(fit.nfev, 4);
  EXPECT_FALSE(fit.success());
  solver.prepare(vector({-1.2, 1.0}));
  EXPECT_TRUE(solver.iterate(rosenbrock));
  EXPECT_EQ(solver.report().status, FitStatus::iteration_limit);
}

TEST(LeastSquares, StartThatCannotBeEvaluatedIsAStatus) {
  const auto refuses = [](const VectorXd&, VectorXd&, MatrixXd*) { return false; };
  const auto not_finite = [](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    rosenbrock(x, r, j);
    r[0] = infinity;
    return true;
  };
  const auto jacobian_not_finite = [](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    rosenbrock(x, r, j);
    (*j)(0, 0) = std::nan("");
    return true;
  };
  LeastSquares solver(named(2), 2);
  const VectorXd start = vector({-1.2, 1.0});
  for (const FitReport& fit :
       {solver.solve(refuses, start), solver.solve(not_finite, start), solver.solve(jacobian_not_finite, start)}) {
    EXPECT_EQ(fit.status, FitStatus::evaluation_failed);
    EXPECT_TRUE(std::isnan(fit.cost));
    EXPECT_EQ(fit.values, start);
  }
  EXPECT_TRUE(solver.solve(rosenbrock, start).success()) << "a failed fit leaves the solver usable";
}

// log(x) = -3 from x = 2: the first Gauss-Newton step lands at x < 0.
TEST(LeastSquares, RefusedEvaluationShortensTheStep) {
  int refused = 0;
  const auto model = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    refused += x[0] <= 0.0 ? 1 : 0;
    r[0] = std::log(x[0]) + 3.0;
    if (j != nullptr) {
      (*j)(0, 0) = 1.0 / x[0];
    }
    return x[0] > 0.0;
  };
  LeastSquares solver(named(1), 1);
  const FitReport fit = solver.solve(model, vector({2.0}));
  EXPECT_GT(refused, 0);
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_NEAR(fit.values[0], std::exp(-3.0), 1e-9);
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

TEST(LeastSquares, CopiesSearchOnTheirOwnWithoutAllocating) {
  const LeastSquares original(named(2), 2);
  LeastSquares copy = original;
  copy.prepare(vector({-1.2, 1.0}));
  const test_support::AllocationCounter counter;
  while (copy.iterate(rosenbrock)) {
  }
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(copy.report().success());
  EXPECT_EQ(original.report().status, FitStatus::not_run);
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

TEST(LeastSquares, BadInputIsRefusedByName) {
  const std::vector<Parameter> good = named(2);
  const auto message = [](auto&& call) -> std::string {
    try {
      call();
    } catch (const ParameterError& error) {
      return std::string("P ") + error.what();
    } catch (const ShapeError& error) {
      return std::string("S ") + error.what();
    }
    return "";
  };
  const auto build = [&](std::vector<Parameter> p, Index m = 5) {
    return message([&] { LeastSquares(std::move(p), m); });
  };
  EXPECT_EQ(build({{"a", 1.0, 1.0}}), "P a: lower = 1 must be < upper = 1");
  EXPECT_EQ(build({{"a", std::nan(""), 1.0}}), "P a: lower = nan must be < upper = 1");
  EXPECT_EQ(build({{"a", 0.0, 1.0, true}}), "P a: lower = 0 must be > 0 for a log-scaled parameter");
  EXPECT_EQ(build({{"a"}, {"a"}}), "P parameter name 'a' appears twice: names must be unique");
  EXPECT_EQ(build({{""}}), "P parameter 0 has no name");
  EXPECT_EQ(build({}), "P parameters is empty: name at least one");
  EXPECT_EQ(build(good, 1), "S n_residuals = 1: must be >= the 2 parameters");
  LeastSquaresOptions options;
  options.initial_damping = -1.0;
  EXPECT_EQ(message([&] { LeastSquares(good, 5, options); }), "P initial_damping = -1: must be in [1e-24, 1e+30]");
  for (double LeastSquaresOptions::* const field :
       {&LeastSquaresOptions::cost_tolerance, &LeastSquaresOptions::step_tolerance,
        &LeastSquaresOptions::gradient_tolerance, &LeastSquaresOptions::initial_damping,
        &LeastSquaresOptions::correlation_limit, &LeastSquaresOptions::rank_tolerance}) {
    LeastSquaresOptions broken;
    broken.*field = std::nan("");
    EXPECT_THROW(broken.validate(), ParameterError);
  }
  options = {};
  options.max_iterations = 0;
  EXPECT_THROW(options.validate(), ParameterError);
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

}  // namespace
}  // namespace mgdd::optimize
