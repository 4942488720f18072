#include "mgdd/optimize/least_squares.hpp"

#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::optimize {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double infinity = std::numeric_limits<double>::infinity();

VectorXd vector(std::initializer_list<double> values) {
  return Eigen::Map<const VectorXd>(values.begin(), static_cast<Index>(values.size()));
}

std::vector<Parameter> named(Index n) {
  std::vector<Parameter> parameters;
  for (Index i = 0; i < n; ++i) {
    parameters.push_back({.name = "p" + std::to_string(i)});
  }
  return parameters;
}

MatrixXd random_matrix(std::uint64_t seed, Index rows, Index columns) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  MatrixXd m(rows, columns);
  for (Index j = 0; j < columns; ++j) {
    for (Index i = 0; i < rows; ++i) {
      m(i, j) = normal(generator);
    }
  }
  return m;
}

struct Linear {
  MatrixXd a;
  VectorXd b;
  bool operator()(const VectorXd& x, VectorXd& r, MatrixXd* j) const {
    r.noalias() = a * x;
    r -= b;
    if (j != nullptr) {
      *j = a;
    }
    return true;
  }
};

// y = p0 exp(-p1 t) on t = 0, 0.1, ...
struct Decay {
  VectorXd y;
  bool operator()(const VectorXd& p, VectorXd& r, MatrixXd* j) const {
    for (Index i = 0; i < y.size(); ++i) {
      const double t = 0.1 * static_cast<double>(i);
      const double e = std::exp(-p[1] * t);
      r[i] = p[0] * e - y[i];
      if (j != nullptr) {
        (*j)(i, 0) = e;
        (*j)(i, 1) = -p[0] * t * e;
      }
    }
    return true;
  }
};

bool rosenbrock(const VectorXd& x, VectorXd& r, MatrixXd* j) {
  r << 10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0];
  if (j != nullptr) {
    *j << -20.0 * x[0], 10.0, -1.0, 0.0;
  }
  return true;
}

FitReport fit_linear(const MatrixXd& a, const VectorXd& b) {
  return LeastSquares(named(a.cols()), a.rows()).solve(Linear{a, b}, VectorXd::Zero(a.cols()));
}

TEST(LeastSquares, LinearProblemReachesTheNormalEquationsAndTheirCovariance) {
  const MatrixXd a = random_matrix(1, 30, 4);
  const VectorXd b = random_matrix(2, 30, 1);
  const FitReport fit = fit_linear(a, b);
  const MatrixXd inverse = (a.transpose() * a).inverse();
  const VectorXd expected = inverse * (a.transpose() * b);
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

// NIST Statistical Reference Datasets, Misra1a: y = b1 (1 - exp(-b2 x)); 11 certified digits.
TEST(LeastSquares, NistMisra1aFromBothStarts) {
  const std::array x{77.6,  114.9, 141.1, 190.8, 239.9, 289.0, 332.8,
                     378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0};
  const std::array y{10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02,
                     44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78};
  const auto model = [&](const VectorXd& b, VectorXd& r, MatrixXd* j) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double e = std::exp(-b[1] * x[i]);
      r[static_cast<Index>(i)] = b[0] * (1.0 - e) - y[i];
      if (j != nullptr) {
        j->row(static_cast<Index>(i)) << 1.0 - e, b[0] * x[i] * e;
      }
    }
    return true;
  };
  LeastSquares solver(named(2), 14);
  for (const VectorXd& start : {vector({500.0, 1e-4}), vector({250.0, 5e-4})}) {
    const FitReport fit = solver.solve(model, start);
    EXPECT_TRUE(fit.success()) << fit.brief();
    EXPECT_NEAR(fit.values[0], 2.3894212918E+02, 1e-7 * 239);
    EXPECT_NEAR(fit.values[1], 5.5015643181E-04, 1e-7 * 5.5e-4);
    EXPECT_NEAR(fit.standard_error[0], 2.7070075241E+00, 1e-7 * 2.7);
    EXPECT_NEAR(fit.standard_error[1], 7.2668688436E-06, 1e-7 * 7.3e-6);
    EXPECT_NEAR(2.0 * fit.cost, 1.2455138894E-01, 1e-10);
    EXPECT_EQ(fit.unidentifiable.size(), 2u) << "their correlation is -0.999";
  }
}

// NIST Statistical Reference Datasets, Thurber: cubic over cubic, 7 parameters, higher difficulty.
TEST(LeastSquares, NistThurberFromBothStarts) {
  const std::array x{-3.067, -2.981, -2.921, -2.912, -2.840, -2.797, -2.702, -2.699, -2.633, -2.481,
                     -2.363, -2.322, -1.501, -1.460, -1.274, -1.212, -1.100, -1.046, -0.915, -0.714,
                     -0.566, -0.545, -0.400, -0.309, -0.109, -0.103, 0.010,  0.119,  0.377,  0.790,
                     0.963,  1.006,  1.115,  1.572,  1.841,  2.047,  2.200};
  const std::array y{80.574,   84.248,   87.264,   87.195,   89.076,   89.608,   89.868,   90.101,
                     92.405,   95.854,   100.696,  101.060,  401.672,  390.724,  567.534,  635.316,
                     733.054,  759.087,  894.206,  990.785,  1090.109, 1080.914, 1122.643, 1178.351,
                     1260.531, 1273.514, 1288.339, 1327.543, 1353.863, 1414.509, 1425.208, 1421.384,
                     1442.962, 1464.350, 1468.705, 1447.894, 1457.628};
  const VectorXd certified = vector({1.2881396800E+03, 1.4910792535E+03, 5.8323836877E+02, 7.5416644291E+01,
                                     9.6629502864E-01, 3.9797285797E-01, 4.9727297349E-02});
  const VectorXd certified_error =
      vector({4.6647963344E+00, 3.9571156086E+01, 2.8698696102E+01, 5.5675370270E+00, 3.1333340687E-02,
              1.4984928198E-02, 6.5842344623E-03});
  const auto model = [&](const VectorXd& b, VectorXd& r, MatrixXd* j) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double t = x[i];
      const double top = b[0] + t * (b[1] + t * (b[2] + t * b[3]));
      const double bottom = 1.0 + t * (b[4] + t * (b[5] + t * b[6]));
      r[static_cast<Index>(i)] = top / bottom - y[i];
      if (j != nullptr) {
        const double f = -top / (bottom * bottom);
        j->row(static_cast<Index>(i)) << 1.0 / bottom, t / bottom, t * t / bottom, t * t * t / bottom, f * t,
            f * t * t, f * t * t * t;
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
    EXPECT_LT((fit.standard_error - certified_error).cwiseQuotient(certified_error).cwiseAbs().maxCoeff(),
              1e-5);
    EXPECT_NEAR(2.0 * fit.cost, 5.6427082397E+03, 1e-6);
  }
}

TEST(LeastSquares, BoundsHoldTheSolutionOfTheReducedProblem) {
  const MatrixXd a = random_matrix(6, 20, 3);
  const VectorXd b = a * vector({2.0, -1.0, 0.5});
  std::vector<Parameter> parameters = named(3);
  parameters[0].upper = 1.0;
  const FitReport fit = LeastSquares(parameters, 20).solve(Linear{a, b}, vector({-5.0, 0.0, 0.0}));
  const MatrixXd rest = a.rightCols(2);
  const VectorXd expected = (rest.transpose() * rest).inverse() * (rest.transpose() * (b - a.col(0)));
  EXPECT_TRUE(fit.success()) << fit.brief();
  EXPECT_EQ(fit.values[0], 1.0);
  EXPECT_LT((fit.values.tail(2) - expected).norm(), 1e-9);
  EXPECT_EQ(fit.bounds_active, Eigen::Vector3i(1, 0, 0));
  EXPECT_EQ(fit.unidentifiable, std::vector<std::string>{"p0"});
  EXPECT_TRUE(std::isnan(fit.standard_error[0]));
  const MatrixXd reduced = (rest.transpose() * rest).inverse() * (2.0 * fit.cost / (20 - 2));
  EXPECT_LT((fit.covariance.bottomRightCorner(2, 2) - reduced).norm(), 1e-12);
}

// With almost no damping one step solves a linear problem, also when it meets a bound on the way.
TEST(LeastSquares, OtherParametersAreSolvedAgainAfterAClip) {
  const MatrixXd a = random_matrix(6, 20, 3);
  std::vector<Parameter> parameters = named(3);
  parameters[0].upper = 1.0;
  LeastSquaresOptions options;
  options.initial_damping = 1e-20;
  const FitReport fit = LeastSquares(parameters, 20, options)
                            .solve(Linear{a, a * vector({2.0, -1.0, 0.5})}, vector({-5.0, 0.0, 0.0}));
  ASSERT_GE(fit.history.size(), 2u);
  EXPECT_NEAR(fit.history[1].cost, fit.cost, 1e-9 * fit.cost);
}

TEST(LeastSquares, StartAtAnOptimumOnTheBoundIsStationary) {
  std::vector<Parameter> parameters = named(2);
  parameters[0].lower = 0.0;
  const MatrixXd identity = MatrixXd::Identity(2, 2);
  const FitReport fit =
      LeastSquares(parameters, 2).solve(Linear{identity, vector({-1.0, 3.0})}, vector({0.0, 3.0}));
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

// The same search, once with bounds and once with a model that refuses every point outside them.
TEST(LeastSquares, ClippingConvergesWhereRejectingDoesNot) {
  const MatrixXd a = random_matrix(7, 20, 4);
  const VectorXd b = a * vector({2.0, -2.0, 2.0, 0.1});
  std::vector<Parameter> boxed = named(4);
  for (Parameter& p : boxed) {
    p.lower = -1.0;
    p.upper = 1.0;
  }
  const Linear model{a, b};
  const auto fenced = [&](const VectorXd& x, VectorXd& r, MatrixXd* j) {
    return x.cwiseAbs().maxCoeff() <= 1.0 && model(x, r, j);
  };
  LeastSquares clipping(boxed, 20), rejecting(named(4), 20);
  int clipping_found = 0, rejecting_found = 0;
  const double best = clipping.solve(model, VectorXd::Zero(4)).cost;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const VectorXd start = random_matrix(100 + seed, 4, 1).array().tanh();
    const FitReport clipped = clipping.solve(model, start);
    clipping_found += clipped.success() && clipped.cost < best * (1 + 1e-9) ? 1 : 0;
    rejecting_found += rejecting.solve(fenced, start).cost < best * (1 + 1e-3) ? 1 : 0;
  }
  EXPECT_EQ(clipping_found, 10);
  EXPECT_LT(rejecting_found, 10);
}

TEST(LeastSquares, LogScalingFindsOrdersOfMagnitudeAndReportsNaturalUnits) {
  VectorXd y(40);
  VectorXd noise = random_matrix(8, 40, 1);
  for (Index i = 0; i < 40; ++i) {
    y[i] = 3e-6 * std::exp(-1.7 * 0.1 * static_cast<double>(i)) + 1e-8 * noise[i];
  }
  std::vector<Parameter> log_scaled{{"a", 1e-12, 1e6, true}, {"rate", 1e-6, 1e6, true}};
  const FitReport in_log = LeastSquares(log_scaled, 40).solve(Decay{y}, vector({1.0, 1e-3}));
  const FitReport natural = LeastSquares(named(2), 40).solve(Decay{y}, vector({2.9e-6, 1.6}));
  EXPECT_TRUE(in_log.success()) << in_log.brief();
  EXPECT_LT((in_log.values - natural.values).cwiseQuotient(natural.values).norm(), 1e-6);
  EXPECT_LT((in_log.standard_error - natural.standard_error).cwiseQuotient(natural.standard_error).norm(),
            1e-6);
  EXPECT_NEAR(in_log.values[1], 1.7, 4 * in_log.standard_error[1]);
}

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
  for (const FitReport& fit : {solver.solve(refuses, start), solver.solve(not_finite, start),
                               solver.solve(jacobian_not_finite, start)}) {
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
  const FitReport at_solution =
      LeastSquares(named(3), 12).solve(Linear{a, VectorXd::Zero(12)}, VectorXd::Zero(3));
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
  EXPECT_EQ(message([&] { LeastSquares(good, 5, options); }),
            "P initial_damping = -1: must be in [1e-24, 1e30]");
  for (double LeastSquaresOptions::* field :
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

TEST(FitReport, StatusesHaveNamesAndOnlyThreeAreSuccess) {
  int successes = 0;
  for (const FitStatus status : {FitStatus::not_run, FitStatus::cost_converged, FitStatus::step_converged,
                                 FitStatus::gradient_converged, FitStatus::iteration_limit,
                                 FitStatus::evaluation_failed, FitStatus::stalled}) {
    EXPECT_NE(to_string(status), "unknown");
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
