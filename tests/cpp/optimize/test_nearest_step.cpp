// The nearest step: the variational inequality that defines a projection, limits that contradict each other, and no
// allocation.
#include "mgdd/optimize/limits/nearest_step.hpp"

#include <Eigen/Cholesky>

#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

double uniform(std::uint64_t index, double low, double high) {
  return low + (high - low) * random::uniform(33, 0, index);
}

struct Problem {
  Inputs wish, lowest, highest;
  InputMatrix metric;
  std::vector<Inputs> slopes;
  std::vector<double> rooms;

  Problem(std::uint64_t trial, Eigen::Index n, std::size_t limits) : metric(n, n) {
    std::uint64_t draw = trial * 1000;
    const auto vector = [&](double size) {
      Inputs v(n);
      for (double& x : v)
        x = uniform(draw++, -size, size);
      return v;
    };
    wish = vector(3.0);
    lowest = -vector(2.0).cwiseAbs();
    highest = vector(2.0).cwiseAbs();
    InputMatrix root(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
      root.col(i) = vector(1.5);
    metric = root * root.transpose() + 0.2 * InputMatrix::Identity(n, n);
    for (std::size_t l = 0; l < limits; ++l) {
      slopes.push_back(vector(2.0));
      rooms.push_back(uniform(draw++, 0.0, 1.5));
    }
  }
  void begin(NearestStep& nearest) const {
    nearest.begin(wish, metric, lowest, highest);
    for (std::size_t l = 0; l < slopes.size(); ++l)
      nearest.add(slopes[l], rooms[l], 1.0);
  }
  bool allows(const Inputs& step, double by) const {
    bool out = ((step - lowest).array() > -by).all() && ((highest - step).array() > -by).all();
    for (std::size_t l = 0; l < slopes.size(); ++l)
      out = out && slopes[l].dot(step) <= rooms[l] + by;
    return out;
  }
};

// The nearest point x of a convex set to w: (w - x)' P^-1 (y - x) <= 0 for every y of the set.
TEST(NearestStep, NoAllowedStepIsNearer) {
  int turned = 0;
  for (std::uint64_t trial = 0; trial < 400; ++trial) {
    const auto n = static_cast<Eigen::Index>(1 + trial % 4);
    const Problem problem(trial, n, 1 + trial % 3);
    NearestStep nearest(problem.slopes.size());
    problem.begin(nearest);
    EXPECT_EQ(nearest.solve(1.0), 0.0);
    const Inputs x = nearest.step();
    ASSERT_TRUE(problem.allows(x, 1e-6)) << trial;
    turned += (x - problem.wish).norm() > 1e-6 ? 1 : 0;
    const Inputs normal = problem.metric.llt().solve(problem.wish - x);
    for (std::uint64_t other = 0; other < 200; ++other) {
      Inputs y(n);
      for (Eigen::Index i = 0; i < n; ++i) {
        y[i] = uniform(900000 + trial * 2000 + other * 8 + static_cast<std::uint64_t>(i), problem.lowest[i],
                       problem.highest[i]);
      }
      if (!problem.allows(y, 0.0)) continue;
      ASSERT_LE(normal.dot(y - x), 1e-5 * (1.0 + normal.norm())) << trial;
    }
  }
  EXPECT_GT(turned, 250);
}

TEST(NearestStep, WhatContradictsIsBrokenEvenlyInScales) {
  NearestStep nearest(2);
  const Inputs none = Inputs::Constant(1, unlimited);
  nearest.begin(scalar_input(0.3), InputMatrix::Ones(1, 1), -none, none);
  nearest.add(scalar_input(1.0), -1.0, 1.0);   // x <= -1, scale 1
  nearest.add(scalar_input(-1.0), -5.0, 3.0);  // x >= 5, scale 3
  EXPECT_NEAR(nearest.solve(10.0), 1.5, 0.01);
  EXPECT_NEAR(nearest.step()[0], 0.5, 0.02);
}

TEST(NearestStep, ALimitThatSaysNothingIsNoLimit) {
  NearestStep nearest(1);
  const Inputs none = Inputs::Constant(2, unlimited), wish = inputs({2.0, -1.0});
  nearest.begin(wish, InputMatrix::Identity(2, 2), -none, none);
  nearest.add(Inputs::Zero(2), -1.0, 1.0);
  EXPECT_EQ(nearest.solve(1.0), 0.0);
  EXPECT_EQ(nearest.step(), wish);
}

}  // namespace
}  // namespace mgdd::optimize
