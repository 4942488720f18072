// Errors of a straight line under white and correlated noise: how often they hold, over many seeds.
#include "mgdd/optimize/least_squares/block_sandwich.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::optimize {
namespace {

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
