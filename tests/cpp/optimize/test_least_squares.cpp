#include "support/fit_cases.hpp"

#include <array>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "support/no_alloc.hpp"
#include "support/reference_algebra.hpp"

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

// NIST Statistical Reference Datasets, Thurber: cubic over cubic, 7 parameters, higher difficulty.
TEST(LeastSquares, NistThurberFromBothStarts) {
  const std::array x{-3.067, -2.981, -2.921, -2.912, -2.840, -2.797, -2.702, -2.699, -2.633, -2.481,
                     -2.363, -2.322, -1.501, -1.460, -1.274, -1.212, -1.100, -1.046, -0.915, -0.714,
                     -0.566, -0.545, -0.400, -0.309, -0.109, -0.103, 0.010,  0.119,  0.377,  0.790,
                     0.963,  1.006,  1.115,  1.572,  1.841,  2.047,  2.200};
  const std::array y{80.574,   84.248,   87.264,   87.195,   89.076,   89.608,   89.868,   90.101,   92.405,   95.854,
                     100.696,  101.060,  401.672,  390.724,  567.534,  635.316,  733.054,  759.087,  894.206,  990.785,
                     1090.109, 1080.914, 1122.643, 1178.351, 1260.531, 1273.514, 1288.339, 1327.543, 1353.863, 1414.509,
                     1425.208, 1421.384, 1442.962, 1464.350, 1468.705, 1447.894, 1457.628};
  const VectorXd certified = vector({1.2881396800E+03, 1.4910792535E+03, 5.8323836877E+02, 7.5416644291E+01,
                                     9.6629502864E-01, 3.9797285797E-01, 4.9727297349E-02});
  const VectorXd certified_error = vector({4.6647963344E+00, 3.9571156086E+01, 2.8698696102E+01, 5.5675370270E+00,
                                           3.1333340687E-02, 1.4984928198E-02, 6.5842344623E-03});
  const auto model = [&](const VectorXd& b, VectorXd& r, MatrixXd* j) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double t = x[i];
      const double top = b[0] + t * (b[1] + t * (b[2] + t * b[3]));
      const double bottom = 1.0 + t * (b[4] + t * (b[5] + t * b[6]));
      r[static_cast<Index>(i)] = top / bottom - y[i];
      if (j != nullptr) {
        const double f = -top / (bottom * bottom);
        j->row(static_cast<Index>(i)) << 1.0 / bottom, t / bottom, t * t / bottom, t * t * t / bottom, f * t, f * t * t,
            f * t * t * t;
      }
    }
    return true;
  };
  LeastSquares solver(named(7), 37);
  for (const VectorXd& start :
       {vector({1000, 1000, 400, 40, 0.7, 0.3, 0.03}), vector({1300, 1500, 500, 75, 1, 0.4, 0.05})}) {
    const FitReport fit = solver.solve(model, start);
    EXPECT_TRUE(fit.success()) << fit.brief();
    EXPECT_LT((fit.values - certified).cwiseQuotient(certified).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((fit.standard_error - certified_error).cwiseQuotient(certified_error).cwiseAbs().maxCoeff(), 1e-5);
    EXPECT_NEAR(2.0 * fit.cost, 5.6427082397E+03, 1e-6);
  }
}

// Facts any Levenberg-Marquardt must show, with stop constants of 1e-12 and a damping that starts at 1e-2.
LeastSquaresOptions tight() {
  LeastSquaresOptions options;
  options.cost_tolerance = options.step_tolerance = options.gradient_tolerance = 1e-12;
  options.initial_damping = 1e-2;
  return options;
}

TEST(LeastSquares, ALinearProblemIsSolvedTo1em8InFourSteps) {
  MatrixXd a(40, 3);
  VectorXd b(40);
  for (Index i = 0; i < 40; ++i) {
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
