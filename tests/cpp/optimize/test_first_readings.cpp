// First readings, and readings that fail.
#include "mgdd/optimize/watch/failure_watch.hpp"
#include "mgdd/optimize/watch/first_readings.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

double bend_of(FirstReadings& first, double slope, double curvature, double noise_sd, double drift, std::uint64_t seed,
               std::int64_t late = 0) {
  std::vector<double> asked;
  for (int k = 0; first.open() && k < 1000; ++k) {
    asked.push_back(first.ask(scalar_input(2.0))[0]);
    const double x = asked[asked.size() - 1 - static_cast<std::size_t>(std::min<std::int64_t>(k, late))] - 2.0;
    first.learn(scalar_input(asked.back()), slope * x + 0.5 * curvature * x * x + drift * k +
                                                noise_sd * random::normal(seed, 9, static_cast<std::uint64_t>(k)));
  }
  return first.bend().maxCoeff();
}

TEST(FirstReadings, BendIsWhatIsSeenOrWhatTheNoiseWouldHideOrWhatTheSlopeAsksFor) {
  const auto fresh = [] { return FirstReadings(scalar_input(1.5), 0.4, true); };
  FirstReadings seen = fresh(), drifting = fresh(), steep = fresh();
  EXPECT_NEAR(bend_of(seen, 0.3, -0.8, 0.0, 0.0, 1), 0.8, 1e-12);
  EXPECT_NEAR(bend_of(drifting, 0.3, 0.8, 0.0, 5.0, 1), 0.8, 1e-9) << "a drift is not a bend";
  EXPECT_NEAR(bend_of(steep, 6.0, 0.0, 0.0, 0.0, 1), 6.0 / (20.0 * 1.5), 1e-12);
  double hidden = 0.0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    FirstReadings noisy = fresh();
    hidden += std::log(bend_of(noisy, 0.1, -0.01, 0.5, 0.0, seed)) / 400.0;
  }
  EXPECT_NEAR(std::exp(hidden), 0.4 * 0.5 / (1.5 * 1.5), 0.03);
}

/// Cycles until the bend is known, where J comes `late` and every `missing`th reading not at all.
int cycles_until_known(FirstReadings& first, std::int64_t late, int missing = 1 << 20) {
  std::vector<double> asked;
  for (int k = 0; k < 1000; ++k) {
    asked.push_back(first.ask(scalar_input(2.0))[0]);
    const double x = asked[asked.size() - 1 - static_cast<std::size_t>(std::min<std::int64_t>(k, late))] - 2.0;
    if (k % missing == missing - 1) {
      first.skip(scalar_input(asked.back()));
    } else {
      first.learn(scalar_input(asked.back()), 0.4 * x - 0.3 * x * x);
    }
    if (!first.open()) return k + 1;
  }
  return -1;
}

TEST(FirstReadings, WaitForALateSensorAndForAJThatMoves) {
  FirstReadings late(scalar_input(1.0), 0.4, true, {}, {{3.0, 0.0}});
  EXPECT_NEAR(bend_of(late, 0.4, -0.6, 0.0, 0.0, 1, 3), 0.6, 1e-12);
  FirstReadings flat(scalar_input(1.0), 0.4, true);
  EXPECT_EQ(bend_of(flat, 0.0, 0.0, 0.0, 0.0, 1), 0.0);
  EXPECT_TRUE(flat.open());
  const FirstReadings known(scalar_input(1.0), 0.4, true, -0.7);
  EXPECT_FALSE(known.open());
  EXPECT_EQ(known.bend().maxCoeff(), 0.7);
}

// 24 points one after the other, whatever the delay; a lag or two delays hold every point for as long as it takes.
TEST(FirstReadings, WaitForADelayOnce) {
  const auto of = [](const std::vector<ComponentLag>& components) {
    return FirstReadings(scalar_input(1.0), 0.4, true, {}, components);
  };
  FirstReadings at_once = of({{}}), late = of({{17.0, 0.0}}), lagged = of({{17.0, 2.0}}), two = of({{}, {5.0, 0.0}});
  EXPECT_EQ(cycles_until_known(at_once, 0), 24);
  EXPECT_EQ(cycles_until_known(late, 17), 24 + 17);
  EXPECT_EQ(cycles_until_known(lagged, 17), 24 * 7 + 17);
  EXPECT_EQ(cycles_until_known(two, 5), 24 * 6);
}

TEST(FirstReadings, WhatIsMissingIsAskedAgainOrLeftOutBehindADelay) {
  FirstReadings at_once(scalar_input(1.0), 0.4, true), late(scalar_input(1.0), 0.4, true, {}, {{17.0, 0.0}});
  EXPECT_EQ(cycles_until_known(at_once, 0, 5), 24 + 5);
  EXPECT_EQ(cycles_until_known(late, 17, 5), 24 + 17);
  EXPECT_NEAR(at_once.bend()[0], 0.6, 1e-12);
  EXPECT_NEAR(late.bend()[0], 0.6, 1e-12);
  FirstReadings never(scalar_input(1.0), 0.4, true, {}, {{17.0, 0.0}});
  EXPECT_EQ(cycles_until_known(never, 17, 4), -1) << "one point is never read";
}

// A plant that goes 0.7 of the way to one side: slope and bend are those between the inputs that it applied. What was
// read before a restart is void.
TEST(FirstReadings, AnUnevenPlantAndARestartLeaveTheBend) {
  FirstReadings first(scalar_input(1.5), 0.4, true);
  const auto cycle = [&first](double level) {
    Inputs x = first.ask(scalar_input(2.0));
    if (x[0] < 2.0) x[0] = 2.0 + 0.7 * (x[0] - 2.0);
    first.learn(x, level + 0.3 * (x[0] - 2.0) - 0.4 * (x[0] - 2.0) * (x[0] - 2.0));
  };
  for (int k = 0; k < 3; ++k)
    cycle(1e3);
  first.restart();
  while (first.open())
    cycle(0.0);
  EXPECT_NEAR(first.bend().maxCoeff(), 0.8, 1e-12);
}

// An input whose plant does not follow to one side shows the noise, and no slope of nothing.
TEST(FirstReadings, APlantThatDoesNotFollowBendsNothing) {
  FirstReadings first({inputs({1.0, 2.0})}, 0.4, true);
  for (int k = 0; first.open(); ++k) {
    Inputs x = first.ask(inputs({0.0, 0.0}));
    x[1] = std::min(x[1], 0.0);
    first.learn(x, -0.5 * x[0] * x[0] - 3.0 * x[1]);
  }
  EXPECT_NEAR(first.bend()[0], 1.0, 1e-12);
  EXPECT_NEAR(first.bend()[1], 1e-3 / 4.0, 1e-12);
}

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
