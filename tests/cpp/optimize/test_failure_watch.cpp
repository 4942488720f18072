// Which inputs make a plant fail: edges are set, tried, moved and taken away; seekers stay on the working side of them.
#include <algorithm>
#include <vector>

#include "mgdd/optimize/watch/failure_watch.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

/// One cycle on a plant that fails above `edge`; returns what was asked of it.
double cycle_at(FailureWatch& watch, double wanted, double edge) {
  const Inputs input = scalar_input(wanted);
  const double asked = watch.admit(input)[0];
  asked > edge ? watch.failed() : watch.worked();
  return asked;
}

TEST(FailureWatch, WhatWorksGoesThroughAsTheSameObject) {
  FailureWatch watch(1);
  const Inputs input = scalar_input(2.0);
  EXPECT_EQ(&watch.admit(input), &input);
  EXPECT_EQ(watch.instead(), nullptr);
  watch.worked();
  EXPECT_EQ(watch.failing_above()[0], unlimited);
  EXPECT_EQ(watch.failing_below()[0], -unlimited);
}

TEST(FailureWatch, TheFourthFailureSetsAnEdgeOnItsSide) {
  for (const double side : {1.0, -1.0}) {
    FailureWatch watch(1);
    const auto told = [&](double wanted, bool fails) {
      const Inputs input = scalar_input(side * wanted);
      const double asked = side * watch.admit(input)[0];
      fails ? watch.failed() : watch.worked();
      return asked;
    };
    told(1.0, false);
    for (int k = 0; k < 3; ++k) {
      told(4.0, true);
      told(2.0, false);  // between them: not in a row, and not as far out
    }
    EXPECT_EQ(told(4.5, true), 4.5);
    EXPECT_EQ(told(4.5, false), 2.0);
    const double edge = side > 0.0 ? watch.failing_above()[0] : -watch.failing_below()[0];
    EXPECT_EQ(edge, 4.0);
    EXPECT_EQ(side * watch.keep(scalar_input(side * 9.0))[0], 2.0);
  }
}

TEST(FailureWatch, ASuccessAsFarOutClearsWhatFailedByChance) {
  FailureWatch watch(1);
  for (int k = 0; k < 40; ++k) {
    const Inputs input = scalar_input(4.0);
    watch.admit(input);
    k % 4 == 3 ? watch.worked() : watch.failed();
  }
  EXPECT_EQ(watch.failing_above()[0], unlimited);
}

// Each input farther in than the last, and of these some fail: as far out has worked since the failures before.
TEST(FailureWatch, FailuresByChanceOfASeekerOnItsWayInSetNoEdge) {
  for (const double side : {1.0, -1.0}) {
    FailureWatch watch(2);
    for (int k = 0; k < 300; ++k) {
      const Inputs input = inputs({side * (300.0 - k + 2.0 * (k % 2)), 0.1});
      watch.admit(input);
      k % 5 == 0 ? watch.failed() : watch.worked();
    }
    EXPECT_TRUE(watch.failing_above().array().isInf().all()) << watch.failing_above();
    EXPECT_TRUE(watch.failing_below().array().isInf().all()) << watch.failing_below();
  }
}

// Where many fail by chance it takes more to set an edge, and a true one is found all the same.
TEST(FailureWatch, TheMoreFailByChanceTheMoreFailuresSetAnEdge) {
  int last = 4;
  for (const int every : {12, 4, 2}) {
    FailureWatch watch(1);
    for (int k = 0; k < 240; ++k) {
      watch.admit(scalar_input(0.5 * (k % 3)));
      k % every == 0 ? watch.failed() : watch.worked();
    }
    cycle_at(watch, 1.0, 3.0);
    int asked = 0;
    while (cycle_at(watch, 8.0, 3.0) > 3.0 && asked < 40)
      ++asked;
    EXPECT_EQ(watch.failing_above()[0], 8.0) << every;
    EXPECT_GE(asked, last) << every;
    EXPECT_LE(asked, 11) << every;
    last = asked + (every == 12 ? 1 : 0);
  }
}

// From 3 on it fails: the edge is closed in on from both sides, and fewer and fewer cycles are spent on it.
TEST(FailureWatch, TheEdgeIsFoundByHalvesAndLookedAtEverLessOften) {
  FailureWatch watch(1);
  cycle_at(watch, 0.0, 3.0);
  int early = 0, late = 0;
  for (int k = 0; k < 4000; ++k)
    (k < 400 ? early : late) += cycle_at(watch, 8.0, 3.0) > 3.0 ? 1 : 0;
  EXPECT_NEAR(watch.failing_above()[0], 3.0, 0.3);
  EXPECT_GT(watch.failing_above()[0], 3.0);
  EXPECT_NEAR(watch.keep(scalar_input(8.0))[0], 3.0, 0.3);
  EXPECT_LE(early, 14);
  EXPECT_LE(late, 20);
}

TEST(FailureWatch, FailuresOfEverythingLeaveNoEdgeAndAreLookedForElsewhere) {
  FailureWatch watch(1);
  for (const double u : {-6.0, 5.0, 4.0})
    cycle_at(watch, u, 99.0);
  std::vector<double> asked;
  for (int k = 0; k < 30; ++k)
    asked.push_back(cycle_at(watch, 4.0, -99.0));
  EXPECT_TRUE(watch.failing_everywhere());
  EXPECT_EQ(watch.failing_above()[0], unlimited);
  for (const double u : {4.0, -6.0, 5.0, -0.5, -3.25, 2.25})  // as wanted, both ends, and between them
    EXPECT_EQ(std::count(asked.begin() + 12, asked.end(), u), 3) << u;
  EXPECT_EQ(cycle_at(watch, 4.0, 99.0) * 0.0, 0.0);
  EXPECT_FALSE(watch.failing_everywhere());
}

TEST(FailureWatch, ARestartVoidsTheEdgesAndKeepsSomewhereToGo) {
  FailureWatch watch(1);
  cycle_at(watch, 0.0, 3.0);
  for (int k = 0; k < 10; ++k)
    cycle_at(watch, 8.0, 3.0);
  watch.forget();
  EXPECT_EQ(watch.failing_above()[0], unlimited);
  for (int k = 0; k < 4; ++k)
    EXPECT_EQ(cycle_at(watch, 8.0, 3.0), 8.0);
  EXPECT_LE(cycle_at(watch, 8.0, 3.0), 3.0);
}

}  // namespace
}  // namespace mgdd::optimize
