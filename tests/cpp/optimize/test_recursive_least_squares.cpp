// Recursive least squares, and errors of an estimate whose residuals hang together.
#include <Eigen/Dense>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/least_squares/block_sandwich.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"
#include "mgdd/optimize/least_squares/recursive_least_squares.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

using Rls = RecursiveLeastSquares<3>;
using Column = Rls::Column;

double draw(int k, int i) {
  return 2.0 * random::uniform(31, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(k)) - 1.0;
}
Column regressor(int k) {
  return {1.0 + 0.3 * draw(k, 0), 2.0 * draw(k, 1), 0.5 * draw(k, 2) - 0.2};
}
double output(int k) {
  return Column(0.7, -1.3, 2.1).dot(regressor(k)) + 0.4 * draw(k, 3);
}

Rls::Settings some_settings() {
  Rls::Settings s;
  s.start << 0.2, -0.4, 0.9;
  s.start_variance << 2.0, 0.5, 3.0;
  s.forgetting = 0.93;
  s.trace_cap = 1e6;
  return s;
}

// The minimum of lambda^n (p - p0)' P0^-1 (p - p0) + sum lambda^(n-k) (y_k - phi_k' p)^2.
TEST(RecursiveLeastSquares, IsTheWeightedLeastSquaresSolutionAfterEveryEquation) {
  const Rls::Settings s = some_settings();
  Rls rls(s);
  Eigen::Matrix3d normal = s.start_variance.cwiseInverse().asDiagonal();
  Column right = normal * s.start;
  for (int k = 0; k < 60; ++k) {
    const Column phi = regressor(k);
    EXPECT_NEAR(rls.predict(phi), phi.dot(rls.estimate()), 1e-12);
    ASSERT_TRUE(rls.update(phi, output(k)));
    normal = 0.93 * normal + phi * phi.transpose();
    right = 0.93 * right + phi * output(k);
    ASSERT_LT((rls.estimate() - normal.ldlt().solve(right)).norm(), 1e-9) << k;
    ASSERT_LT((rls.covariance() - normal.inverse()).norm(), 1e-9) << k;
    ASSERT_EQ(rls.updates(), k + 1);
  }
}

TEST(RecursiveLeastSquares, AVarianceOfZeroHoldsAParameter) {
  Rls::Settings s = some_settings();
  s.start_variance[1] = 0.0;
  Rls rls(s);
  for (int k = 0; k < 40; ++k)
    ASSERT_TRUE(rls.update(regressor(k), output(k)));
  EXPECT_EQ(rls.estimate()[1], -0.4);
  EXPECT_NE(rls.estimate()[0], 0.2);
}

TEST(RecursiveLeastSquares, TheEstimateStaysInItsBox) {
  Rls::Settings s = some_settings();
  s.lower << 0.1, -0.9, -5.0;
  s.upper << 5.0, 5.0, 1.4;
  Rls rls(s);
  bool at_lower = false, at_upper = false;
  for (int k = 0; k < 80; ++k) {
    ASSERT_TRUE(rls.update(regressor(k), output(k)));
    at_lower = at_lower || rls.estimate()[1] == -0.9;
    at_upper = at_upper || rls.estimate()[2] == 1.4;
    ASSERT_TRUE((rls.estimate().array() >= s.lower.array()).all());
    ASSERT_TRUE((rls.estimate().array() <= s.upper.array()).all());
  }
  EXPECT_TRUE(at_lower && at_upper);
}

// Without excitation P grows by 1/lambda per equation, up to the cap and no further; what is known stays known.
TEST(RecursiveLeastSquares, TheTraceGrowsByForgettingUpToItsCap) {
  Rls::Settings s = some_settings();
  s.trace_cap = 2.0;
  Rls rls(s);
  const double start = 5.5;
  for (int k = 0; k < 30; ++k) {
    ASSERT_TRUE(rls.update(Column::Zero(), 0.0));
    const double free_growth = start * std::pow(1.0 / 0.93, k + 1);
    EXPECT_NEAR(rls.covariance().trace(), std::min(free_growth, 2.0 * start), 1e-9) << k;
  }
  EXPECT_EQ(rls.estimate(), s.start);
  Rls::Settings none = some_settings();  // a covariance above the cap is left alone, not shrunk
  none.trace_cap = 1.0;
  Rls capped(none);
  ASSERT_TRUE(capped.update(Column::Zero(), 0.0));
  EXPECT_NEAR(capped.covariance().trace(), start, 1e-12);
}

TEST(RecursiveLeastSquares, WhatIsNotFiniteChangesNothing) {
  Rls rls(some_settings());
  ASSERT_TRUE(rls.update(regressor(0), output(0)));
  const StateColumns before = save_state(rls);
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(rls.update(regressor(1), inf));
  EXPECT_FALSE(rls.update({1.0, std::nan(""), 0.0}, 1.0));
  EXPECT_FALSE(rls.update({1e200, 1e200, 1e200}, 1e200));
  EXPECT_EQ(save_state(rls), before);
  Rls other(some_settings());
  restore_state(other, before);
  ASSERT_TRUE(rls.update(regressor(2), output(2)));
  ASSERT_TRUE(other.update(regressor(2), output(2)));
  EXPECT_EQ(save_state(other), save_state(rls));
  EXPECT_EQ(other.updates(), 2);
}

TEST(RecursiveLeastSquares, SettingsAndStatesHaveTheirBounds) {
  const auto refused = [](auto change, const std::string& part) {
    Rls::Settings s = some_settings();
    EXPECT_NO_THROW(Rls{s});
    change(s);
    try {
      Rls{s};
      ADD_FAILURE() << part;
    } catch (const ParameterError& error) {
      EXPECT_EQ(std::string(error.what()).rfind(part, 0), 0U) << error.what();
    }
  };
  refused([](auto& s) { s.forgetting = 1.001; }, "forgetting = 1.001");
  refused([](auto& s) { s.forgetting = 0.49; }, "forgetting = 0.49");
  refused([](auto& s) { s.trace_cap = 0.9; }, "trace_cap = 0.9");
  refused([](auto& s) { s.lower[1] = 0.1, s.upper[1] = 0.0; }, "lower[1] = 0.1: must be <= upper");
  refused([](auto& s) { s.upper[2] = 0.8; }, "start[2] = 0.9");
  refused([](auto& s) { s.start_variance[0] = -1.0; }, "start_variance[0] = -1");
  Rls::Settings s = some_settings();
  s.lower = s.start.array() - 0.1;
  s.upper = s.start.array() + 0.2;
  s.forgetting = s.trace_cap = 1.0;
  Rls rls(s);
  for (std::size_t i = 0; i < 3; ++i) {
    StateColumns state = save_state(rls);
    state["estimate"][i] = s.upper[static_cast<Eigen::Index>(i)] + 3.0;
    EXPECT_THROW(restore_state(rls, state), ParameterError) << i;
    EXPECT_EQ(rls.estimate(), s.start);
  }
}

// Offset 3 and slope -2 over 8 s at 1 ms; noise with the autocorrelation a^lag.
struct Line {
  Eigen::Index n = 8000;
  Eigen::VectorXd noise;

  Line(double a, std::uint64_t seed, Eigen::Index rows = 8000) : n(rows), noise(rows) {
    double slow = random::normal(seed, 1, 0) / std::sqrt(1.0 - a * a);
    for (Eigen::Index k = 0; k < n; ++k) {
      noise[k] = slow;
      slow = a * slow + random::normal(seed, 0, static_cast<std::uint64_t>(k));
    }
  }
  double time(Eigen::Index k) const { return 1e-3 * static_cast<double>(k % 8000); }
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) const {
    for (Eigen::Index k = 0; k < n; ++k) {
      residual[k] = x[0] + x[1] * time(k) - (3.0 - 2.0 * time(k) + noise[k]);
      if (jacobian != nullptr) jacobian->row(k) << 1.0, time(k);
    }
    return true;
  }
};

FitReport fitted(const Line& line, const std::vector<ResidualRecord>& records) {
  LeastSquares search({{.name = "offset"}, {.name = "slope"}}, line.n);
  FitReport report = search.solve(line, Eigen::Vector2d(0.0, 0.0));
  if (!records.empty()) block_sandwich(report, search.jacobian(), records);
  return report;
}

TEST(BlockSandwich, WhiteNoiseGivesThePlainErrors) {
  double ratio = 0.0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Line line(0.0, seed);
    const FitReport plain = fitted(line, {}), block = fitted(line, {{0, line.n, 1e-3}});
    EXPECT_TRUE(std::isnan(plain.residual_blocks));
    EXPECT_NEAR(block.residual_blocks, 32.0, 0.1) << "blocks of 0.25 s";
    ratio += block.standard_error[1] / plain.standard_error[1] / 40.0;
    EXPECT_EQ(block.correlation, plain.correlation);
  }
  EXPECT_NEAR(ratio, 1.0, 0.1);
}

TEST(BlockSandwich, HoldsWhereThePlainErrorsDoNot) {
  constexpr int seeds = 500;
  int plain_holds = 0, block_holds = 0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    const Line line(0.98, seed);
    const FitReport plain = fitted(line, {}), block = fitted(line, {{0, line.n, 1e-3}});
    const double error = std::abs(plain.values[1] + 2.0);
    plain_holds += error < 1.96 * plain.standard_error[1] ? 1 : 0;
    block_holds += error < 2.05 * block.standard_error[1] ? 1 : 0;  // Student t of 27 degrees of freedom
  }
  EXPECT_LT(plain_holds, seeds * 40 / 100);
  EXPECT_GE(block_holds, seeds * 90 / 100);
  EXPECT_LE(block_holds, seeds * 99 / 100);
}

TEST(BlockSandwich, TwoIdenticalRecordsHalveTheVariance) {
  const Line one(0.9, 7);
  Line two(0.9, 7, 16'000);
  two.noise << one.noise, one.noise;
  const FitReport single = fitted(one, {{0, 8000, 1e-3}});
  const FitReport both = fitted(two, {{0, 8000, 1e-3}, {8000, 8000, 1e-3}});
  EXPECT_NEAR(both.values[1], single.values[1], 1e-9);
  EXPECT_NEAR(both.covariance(1, 1) / single.covariance(1, 1), 0.5, 0.05);  // a block weighs less among more
  EXPECT_NEAR(both.residual_blocks, 2.0 * single.residual_blocks, 1e-9);
}

// Two records with offsets of their own: their spread says more than the noise within.
TEST(BlockSandwich, TheSpreadOfTwoRecordsCountsWhereItIsLarger) {
  Line two(0.0, 3, 16'000);
  two.noise.head(8000).array() += 5.0;
  two.noise.tail(8000).array() -= 5.0;
  const FitReport report = fitted(two, {{0, 8000, 1e-3}, {8000, 8000, 1e-3}});
  EXPECT_GT(report.standard_error[0], 3.0) << "noise alone gives 0.02";
  EXPECT_NEAR(report.values[0], 3.0, 0.1);
}

TEST(BlockSandwich, WhatIsHeldStaysUndefinedAndWrongRowsAreRefused) {
  const Line line(0.5, 1);
  LeastSquares search({{.name = "offset", .upper = 2.0}, {.name = "slope"}}, line.n);
  FitReport report = search.solve(line, Eigen::Vector2d(0.0, 0.0));
  EXPECT_THROW(block_sandwich(report, search.jacobian(), {{0, 100, 1e-3}}), ShapeError);
  EXPECT_TRUE(std::isnan(report.residual_blocks)) << "a refused call changes nothing";
  block_sandwich(report, search.jacobian(), {{0, line.n, 1e-3}});
  EXPECT_TRUE(std::isnan(report.standard_error[0]));
  EXPECT_GT(report.standard_error[1], 0.0);
}

}  // namespace
}  // namespace mgdd::optimize
