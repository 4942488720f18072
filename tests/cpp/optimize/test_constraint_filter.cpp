// Planes of measured limits, and the nearest step that they allow.
#include <Eigen/Cholesky>

#include <gtest/gtest.h>

#include "mgdd/optimize/limits/nearest_step.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

double uniform(std::uint64_t index, double low, double high) {
  return low + (high - low) * random::uniform(21, 0, index);
}

// --- the plane that it learns -------------------------------------------------------------------------------

TEST(LocalModel, ReturnsThePlaneThatTheDataLieOn) {
  for (Eigen::Index n = 1; n <= 3; ++n) {
    LocalModel model(n, 12.0);
    Inputs slope(n), x(n);
    for (Eigen::Index i = 0; i < n; ++i)
      slope[i] = 0.7 - static_cast<double>(i);
    for (std::uint64_t k = 0; k < 60; ++k) {
      for (Eigen::Index i = 0; i < n; ++i)
        x[i] = uniform(k * 10 + static_cast<std::uint64_t>(i), -2.0, 5.0);
      model.record(x, 100.0 + slope.dot(x));
    }
    EXPECT_LT((model.slope() - slope).norm(), 1e-8);
    EXPECT_NEAR(model.predict(x * 2.0), 100.0 + 2.0 * slope.dot(x), 1e-6);
    EXPECT_NEAR(model.cycles(), 12.0, 0.1);
    EXPECT_TRUE(model.slope_known(2.0));
    model.forget();
    EXPECT_EQ(model.cycles(), 0.0);
    EXPECT_EQ(model.slope(), Inputs::Zero(n));
    EXPECT_FALSE(model.slope_known(2.0));
  }
}

TEST(LocalModel, DoesNotClaimASlopeThatNoiseExplains) {
  int claims = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    LocalModel model(1, 40.0);
    for (std::uint64_t k = 0; k < 40; ++k)
      model.record(scalar_input(std::sin(0.6283 * static_cast<double>(k))), random::normal(seed, 1, k));
    claims += model.slope_known(3.0) ? 1 : 0;
  }
  EXPECT_LT(claims, 20);
}

// --- what it lets pass --------------------------------------------------------------------------------------

/// A filter that knows planes value = level + slope x, from exact measurements around `at`.
ConstraintFilter taught(std::vector<Limit> limits, const std::vector<Inputs>& slopes, const std::vector<double>& levels,
                        const Inputs& at) {
  for (Limit& limit : limits)
    limit.margin_sd = 0.0;
  ConstraintFilter filter(limits, at.size(), 30.0);
  std::vector<double> values(limits.size());
  for (std::uint64_t k = 0; k < 40; ++k) {
    Inputs x = at;
    for (Eigen::Index i = 0; i < at.size(); ++i)
      x[i] += uniform(k * 10 + static_cast<std::uint64_t>(i), -1.0, 1.0);
    for (std::size_t l = 0; l < limits.size(); ++l)
      values[l] = levels[l] + slopes[l].dot(x);
    filter.record(x, values);
  }
  return filter;
}

/// Without bounds, in the plain metric, back no faster than the rate.
Inputs project(ConstraintFilter& filter, const Inputs& at, const Inputs& step, const Inputs& reach,
               const Inputs& rate) {
  const SearchSpace space = space_at(at);
  return filter.project(at, step, {space, reach, reach, rate, rate, InputMatrix::Identity(at.size(), at.size())});
}

TEST(ConstraintFilter, NeverAdmitsAStepWhosePredictionIsOverALimit) {
  int turned = 0;
  for (std::uint64_t trial = 0; trial < 3000; ++trial) {
    const auto n = static_cast<Eigen::Index>(1 + trial % 3);
    const std::size_t count = 1 + trial % 2;
    std::uint64_t draw = trial * 100;
    const auto vector = [&](double size) {
      Inputs v(n);
      for (Eigen::Index i = 0; i < n; ++i)
        v[i] = uniform(draw++, -size, size);
      return v;
    };
    const Inputs at = vector(5.0), step = vector(3.0), reach = vector(1.0).cwiseAbs();
    const Inputs rate = vector(2.0).cwiseAbs();
    std::vector<Limit> limits;
    std::vector<Inputs> slopes;
    std::vector<double> levels;
    for (std::size_t l = 0; l < count; ++l) {
      slopes.push_back(vector(2.0));
      const double room = uniform(draw++, 0.0, 2.0) + slopes[l].cwiseAbs().dot(reach);
      levels.push_back(uniform(draw++, -50.0, 50.0));
      limits.push_back({"l" + std::to_string(l), levels[l] + slopes[l].dot(at) + room + 0.5, 0.5});
    }
    ConstraintFilter filter = taught(limits, slopes, levels, at);
    const Inputs out = project(filter, at, step, reach, rate);
    for (std::size_t l = 0; l < count; ++l)
      ASSERT_LE(filter.excess(l, at + out, reach), 1e-6) << "trial " << trial;
    ASSERT_TRUE(((rate - out.cwiseAbs()).array() > -1e-12).all()) << "trial " << trial;
    if (filter.active()) {
      ++turned;
    } else {
      ASSERT_EQ(out, step.cwiseMax(-rate).cwiseMin(rate));
    }
  }
  EXPECT_GT(turned, 500);
  EXPECT_LT(turned, 2700);
}

TEST(ConstraintFilter, SlidesAlongALimitInSeveralInputs) {
  const Inputs slope = inputs({3.0, 4.0}), at = inputs({0.0, 0.0});
  ConstraintFilter filter = taught({{"l", 10.0}}, {slope}, {10.0}, at);
  const Inputs out = project(filter, at, inputs({1.0, 1.0}), Inputs::Zero(2), Inputs::Constant(2, 5.0));
  EXPECT_NEAR(slope.dot(out), 0.0, 1e-6);
  EXPECT_LT((out - inputs({0.16, -0.12})).norm(), 1e-6);  // the step less its part along the slope
  EXPECT_TRUE(filter.active());
}

TEST(ConstraintFilter, ComesBackAlongTheSlopeNoFasterThanTheRate) {
  const Inputs slope = scalar_input(2.0), at = scalar_input(5.0), reach = scalar_input(1.0);
  ConstraintFilter filter = taught({{"l", 10.0, 1.0}}, {slope}, {0.0}, at);  // 2 (x + 1) <= 9: x <= 3.5
  EXPECT_NEAR(filter.excess(0, at, reach), 3.0, 1e-6);
  EXPECT_NEAR(project(filter, at, scalar_input(0.4), reach, scalar_input(10.0))[0], -1.5, 1e-6);
  EXPECT_NEAR(project(filter, at, scalar_input(0.4), reach, scalar_input(0.3))[0], -0.3, 1e-12);
  EXPECT_TRUE(filter.active());
}

TEST(ConstraintFilter, GoesToTheLastGoodPointWhileTheSlopeIsNotKnown) {
  ConstraintFilter filter({{"l", 10.0}}, 1, 30.0);
  const Inputs none = scalar_input(0.0), rate = scalar_input(0.5);
  EXPECT_EQ(project(filter, scalar_input(3.0), scalar_input(0.4), none, rate)[0], 0.4) << "nothing is known yet";
  const double low[] = {9.0}, high[] = {40.0};
  filter.record(scalar_input(3.0), low);
  EXPECT_EQ(project(filter, scalar_input(3.0), none, none, rate)[0], 0.0);
  filter.record(scalar_input(3.0), high);
  EXPECT_NEAR(project(filter, scalar_input(3.2), scalar_input(0.3), none, rate)[0], -0.2, 1e-12);
  EXPECT_EQ(project(filter, scalar_input(9.0), scalar_input(0.3), none, rate)[0], -0.5);
  filter.forget();
  filter.record(scalar_input(3.0), high);
  EXPECT_EQ(project(filter, scalar_input(9.0), scalar_input(0.3), scalar_input(1.0), rate)[0], 0.0)
      << "the dither looks";
  EXPECT_EQ(project(filter, scalar_input(9.0), scalar_input(0.3), none, rate)[0], 0.3) << "no dither: the steps look";
}

TEST(ConstraintFilter, AlarmsAfterThreeCyclesInARowOverTheSameLimit) {
  ConstraintFilter filter({{"a", 10.0, 1.0}, {"b", 5.0}}, 1, 30.0);
  const auto record = [&](double a, double b) {
    const double values[] = {a, b};
    filter.record(scalar_input(0.0), values);
    return filter.alarmed();
  };
  EXPECT_FALSE(record(9.5, 1.0));
  EXPECT_FALSE(record(9.5, 6.0));
  EXPECT_TRUE(record(9.5, 1.0));
  EXPECT_FALSE(record(9.0, 6.0));
  EXPECT_FALSE(record(9.5, 6.0));
  EXPECT_TRUE(record(9.5, 6.0));
  filter.forget();
  EXPECT_FALSE(filter.alarmed());
}

// --- what it adds to J --------------------------------------------------------------------------------------

double shaping(Limit limit, double value) {
  const ConstraintFilter filter({std::move(limit)}, 1, 10.0);
  const double values[] = {value};
  return filter.shaping(scalar_input(0.0), values);
}

TEST(ConstraintFilter, PenaltyIsTheSquareOfTheScaledExcess) {
  const Limit limit{"l", 100.0, 2.0, LimitMethod::penalty, 3.0, 10.0};
  EXPECT_EQ(shaping(limit, 97.9), 0.0);
  EXPECT_NEAR(shaping(limit, 118.0), -3.0 * 4.0, 1e-12);
  EXPECT_NEAR(shaping({"l", -50.0, 0.0, LimitMethod::penalty, 1.0}, 0.0), -1.0, 1e-12) << "scale: the limit itself";
  EXPECT_EQ(shaping({"l", 100.0}, 500.0), 0.0) << "switching leaves J alone";
}

TEST(ConstraintFilter, BarrierIsTheLogarithmOfTheRoomAndGoesOnAsItsTangent) {
  const Limit limit{"l", 100.0, 0.0, LimitMethod::barrier, 2.0, 10.0};
  EXPECT_NEAR(shaping(limit, 90.0), 0.0, 1e-12);
  EXPECT_NEAR(shaping(limit, 95.0), 2.0 * std::log(0.5), 1e-12);
  const double edge = 100.0 - 0.01 * 10.0;
  EXPECT_NEAR(shaping(limit, edge), 2.0 * std::log(0.01), 1e-9);
  EXPECT_NEAR((shaping(limit, edge + 1e-6) - shaping(limit, edge - 1e-6)) / 2e-6, -2.0 / 0.1, 1e-3);
  EXPECT_NEAR(shaping(limit, 120.0), 2.0 * (std::log(0.01) - 2.01 / 0.01), 1e-9);
}

double step_of(std::uint64_t index, double low, double high) {
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
        x = step_of(draw++, -size, size);
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
      rooms.push_back(step_of(draw++, 0.0, 1.5));
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
        y[i] = step_of(900000 + trial * 2000 + other * 8 + static_cast<std::uint64_t>(i), problem.lowest[i],
                       problem.highest[i]);
      }
      if (!problem.allows(y, 0.0)) continue;
      ASSERT_LE(normal.dot(y - x), 1e-5 * (1.0 + normal.norm())) << trial;
    }
  }
  EXPECT_GT(turned, 250);
}

// The multipliers: none below 0, none where there is room, and with those of the box they make up for the wish.
TEST(NearestStep, TellsWhatEveryLimitCosts) {
  int pushing = 0;
  for (std::uint64_t trial = 0; trial < 400; ++trial) {
    const Problem problem(trial, static_cast<Eigen::Index>(1 + trial % 4), 1 + trial % 3);
    NearestStep nearest(problem.slopes.size());
    problem.begin(nearest);
    nearest.solve(0.0);
    const Inputs x = nearest.step();
    Inputs left = problem.metric.llt().solve(problem.wish - x);
    for (std::size_t l = 0; l < problem.slopes.size(); ++l) {
      const double own = nearest.multiplier(l), room = problem.rooms[l] - problem.slopes[l].dot(x);
      EXPECT_GE(own, 0.0) << trial;
      EXPECT_NEAR(own * room, 0.0, 1e-6 * (1.0 + own)) << trial;
      left -= own * problem.slopes[l];
      pushing += own > 1e-3 ? 1 : 0;
    }
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      EXPECT_GE(left[i], x[i] > problem.lowest[i] + 1e-6 ? -1e-4 : -unlimited) << trial;
      EXPECT_LE(left[i], x[i] < problem.highest[i] - 1e-6 ? 1e-4 : unlimited) << trial;
    }
  }
  EXPECT_GT(pushing, 100);
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
  NearestStep nearest(2);
  const Inputs none = Inputs::Constant(2, unlimited), wish = inputs({2.0, -1.0});
  nearest.begin(wish, InputMatrix::Identity(2, 2), -none, none);
  nearest.add(Inputs::Zero(2), -1.0);
  nearest.add(inputs({0.0, -1.0}), 0.25);
  EXPECT_EQ(nearest.solve(1.0), 0.0);
  EXPECT_EQ(nearest.step(), inputs({2.0, -0.25}));
  EXPECT_EQ(nearest.multiplier(0), 0.0);
  EXPECT_EQ(nearest.multiplier(1), 0.75);
}

}  // namespace
}  // namespace mgdd::optimize
