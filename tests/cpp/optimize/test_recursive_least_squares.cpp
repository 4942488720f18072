// Recursive least squares against the weighted problem that it solves, its box, its cap, and what it keeps and refuses.
#include "mgdd/optimize/least_squares/recursive_least_squares.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include <Eigen/Dense>

#include "mgdd/common/random.hpp"
#include "mgdd/common/state.hpp"

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

}  // namespace
}  // namespace mgdd::optimize
