// The quadratic program of a horizon: the stacked least-squares solution without limits, the conditions of Karush,
// Kuhn and Tucker with them, feasible and never dearer whenever it is stopped, both scalars, no allocation.
#include "mgdd/control/horizon_qp.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/horizon_case.hpp"
#include "support/no_alloc.hpp"
#include "support/reference_algebra.hpp"

namespace mgdd::control {
namespace {

using test_support::RandomHorizon;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(HorizonQp, WithoutLimitsItIsTheStackedLeastSquaresSolution) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    RandomHorizon<15, 3> p(seed, 2.0, false);
    p.qp.set.limit(-1e30, 1e30, 1e30);
    ASSERT_EQ(p.qp.solve(p.deviation, p.limits.before, 1), QpResult::solved) << seed;
    const auto dense = test_support::stacked(p.qp, p.deviation, p.limits.before);
    const Eigen::VectorXd expected = test_support::solved(dense.hessian, -dense.slope);
    EXPECT_LT((p.solution() - expected).cwiseAbs().maxCoeff(), 1e-9 * (1.0 + expected.cwiseAbs().maxCoeff())) << seed;
    EXPECT_NEAR(p.qp.cost(), dense.cost(p.solution()), 1e-9 * (1.0 + dense.constant));
  }
}

TEST(HorizonQp, ALongHorizonGivesTheGainOfTheAlgebraicRiccatiEquation) {
  Eigen::Matrix3d a;
  a << 0.9, 0.2, -0.1, -0.3, 1.05, 0.25, 0.05, -0.2, 0.8;
  const Eigen::Vector3d b(0.1, 0.4, -0.3), c(1.0, -0.5, 0.2);
  const double q = 3.0, r = 0.7;
  Eigen::Matrix3d p = Eigen::Matrix3d::Identity();  // by doubling (Chu, Fan, Lin and Wang 2004), not by a recursion
  {
    Eigen::Matrix3d ak = a, g = b * b.transpose() / r, h = q * c * c.transpose();
    for (int i = 0; i < 30; ++i) {
      const Eigen::Matrix3d w = (Eigen::Matrix3d::Identity() + g * h).inverse();
      const Eigen::Matrix3d next = ak * w * ak;
      const Eigen::Matrix3d g_next = g + ak * w * g * ak.transpose();
      h = (h + ak.transpose() * h * w * ak).eval();
      ak = next;
      g = g_next;
    }
    p = h;
  }
  const Eigen::RowVector3d gain = (b.transpose() * p * a) / (r + b.dot(p * b));
  HorizonQp<double, 150, 3> qp;
  qp.set.limit(-1e30, 1e30, 1e30);
  qp.input_weight = r;
  const Eigen::Vector3d x(0.7, -1.1, 0.4);
  Eigen::Vector3d at = x;
  for (auto& stage : qp.stages) {
    stage.a = a;
    stage.b = b;
    stage.c = c;
    stage.weight = q;
    at = a * at;
    stage.error = 0.0;
  }
  qp.invalidate();
  ASSERT_EQ(qp.solve(x, 0.0, 1), QpResult::solved);
  EXPECT_NEAR(qp.input()[0], -gain.dot(x), 1e-11);
}

TEST(HorizonQp, TheConditionsOfOptimalityHoldOnAThousandProblems) {
  std::vector<int> sweeps;
  int bounded = 0, tied = 0, both = 0;
  for (unsigned seed = 0; seed < 1000; ++seed) {
    RandomHorizon<12, 3> p(seed, seed % 2 == 0 ? 3.0 : 0.6, seed % 5 != 0);
    ASSERT_EQ(p.qp.solve(p.deviation, p.limits.before, 200), QpResult::solved) << seed;
    const auto dense = test_support::stacked(p.qp, p.deviation, p.limits.before);
    ASSERT_LT(test_support::broken_optimality(dense, p.solution(), p.limits), 1e-9) << seed;
    EXPECT_NEAR(p.qp.cost(), dense.cost(p.solution()), 1e-9 * (1.0 + dense.constant));
    sweeps.push_back(p.qp.sweeps());
    for (std::size_t k = 0; k < 12; ++k) {
      bounded += p.qp.set.bounds()[k] != 0;
      tied += p.qp.set.ties()[k] != 0;
      both += p.qp.set.bounds()[k] != 0 && p.qp.set.ties()[k] != 0;
    }
  }
  EXPECT_GT(bounded, 1000);
  EXPECT_GT(tied, 1000);
  EXPECT_GT(both, 30);  // a bound that holds a run by another of its inputs
  std::ranges::sort(sweeps);
  RecordProperty("median_sweeps", sweeps[500]);
  RecordProperty("most_sweeps", sweeps.back());
  EXPECT_LE(sweeps[500], 6);
  EXPECT_LE(sweeps.back(), 60);
}

TEST(HorizonQp, ASecondSolveFromTheSolutionTakesOneSweepAndStays) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    RandomHorizon<12, 3> p(seed, 2.0, true);
    ASSERT_EQ(p.qp.solve(p.deviation, p.limits.before, 200), QpResult::solved);
    const Eigen::VectorXd first = p.solution();
    for (std::size_t k = 0; k < 12; ++k) {  // the same problem about the solution
      auto& stage = p.qp.stages[k];
      Eigen::Vector3d x = p.deviation;
      for (std::size_t i = 0; i <= k; ++i)
        x = p.qp.stages[i].a * x + p.qp.stages[i].b * (p.qp.input()[i] - p.qp.nominal[i]);
      stage.error += stage.c.dot(x);
    }
    p.qp.nominal = p.qp.input();
    p.qp.invalidate();
    ASSERT_EQ(p.qp.solve(Eigen::Vector3d::Zero(), p.limits.before, 200), QpResult::solved);
    EXPECT_LE(p.qp.sweeps(), 2) << seed;  // two where a multiplier is zero to rounding
    EXPECT_LT((p.solution() - first).cwiseAbs().maxCoeff(), 1e-8) << seed;
  }
}

TEST(HorizonQp, StoppedAnywhereItIsFeasibleAndNeverDearer) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    double last = std::numeric_limits<double>::infinity();
    for (int most = 1; most < 40; ++most) {
      RandomHorizon<12, 3> p(seed, 3.0, true);
      const auto dense = test_support::stacked(p.qp, p.deviation, p.limits.before);
      const auto result = p.qp.solve(p.deviation, p.limits.before, most);
      const Eigen::VectorXd u = p.solution();
      double before = p.limits.before;
      for (Eigen::Index k = 0; k < 12; ++k) {
        ASSERT_GE(u(k), p.limits.lower);
        ASSERT_LE(u(k), p.limits.upper);
        ASSERT_LE(std::abs(u(k) - before), p.limits.largest_change + 1e-15);
        before = u(k);
      }
      const double cost = dense.cost(u);
      ASSERT_LE(cost, last + 1e-10 * (1.0 + dense.constant)) << seed << " " << most;
      last = cost;
      if (result == QpResult::solved) break;
    }
  }
}

TEST(HorizonQp, FloatAgreesWithDouble) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    RandomHorizon<12, 3> p(seed, 1.5, true);
    if (p.qp.input_weight + p.qp.change_weight < 0.05) continue;
    HorizonQp<float, 12, 3> narrow;
    for (std::size_t k = 0; k < 12; ++k) {
      const auto& from = p.qp.stages[k];
      narrow.stages[k] = {from.a.cast<float>(), from.b.cast<float>(), from.c.cast<float>(),
                          static_cast<float>(from.error), static_cast<float>(from.weight)};
      narrow.nominal[k] = static_cast<float>(p.qp.nominal[k]);
    }
    narrow.input_weight = static_cast<float>(p.qp.input_weight);
    narrow.change_weight = static_cast<float>(p.qp.change_weight);
    narrow.set.limit(static_cast<float>(p.limits.lower), static_cast<float>(p.limits.upper),
                     static_cast<float>(p.limits.largest_change));
    narrow.set.clamp(narrow.nominal, static_cast<float>(p.limits.before));
    narrow.invalidate();
    ASSERT_EQ(p.qp.solve(p.deviation, p.limits.before, 200), QpResult::solved);
    ASSERT_EQ(narrow.solve(p.deviation.cast<float>(), static_cast<float>(p.limits.before), 200), QpResult::solved)
        << seed;
    for (std::size_t k = 0; k < 12; ++k)
      EXPECT_NEAR(narrow.input()[k], p.qp.input()[k], 5e-3) << seed;
  }
}

TEST(HorizonQp, WhatIsNotFiniteIsSaid) {
  RandomHorizon<12, 3> p(3, 1.0, true);
  EXPECT_EQ(p.qp.solve(Eigen::Vector3d(0.1, nan, 0.0), p.limits.before, 50), QpResult::not_finite);
  p.qp.stages[4].a(1, 2) = nan;
  p.qp.invalidate();
  EXPECT_EQ(p.qp.solve(p.deviation, p.limits.before, 50), QpResult::not_finite);
}

TEST(HorizonQp, NoAllocation) {
  RandomHorizon<12, 3> p(8, 3.0, true);
  static_assert(noexcept(p.qp.solve(p.deviation, 0.0, 1)) && noexcept(p.qp.factor(0.0)));
  const test_support::AllocationCounter counter;
  p.qp.factor(p.limits.before);
  (void)p.qp.solve(p.deviation, p.limits.before, 100);
  EXPECT_EQ(counter.count(), 0U);
}

}  // namespace
}  // namespace mgdd::control
