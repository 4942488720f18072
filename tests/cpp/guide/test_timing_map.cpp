// The map of the best timing: what one optimum teaches its cells, forgetting, real time.
#include "mgdd/guide/timing_map.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "mgdd/common/random.hpp"
#include "mgdd/common/state.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::guide {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double plane(double speed, double fuel) {
  return -2.0 - 0.003 * speed + 0.2 * fuel + 1e-4 * speed * fuel;  // bilinear, so that the map can hold it exactly
}

/// Uneven axes of three speeds and four fuels; zero everywhere where `start` is null.
TimingMapSettings uneven(bool filled, double forgetting = 1.0) {
  TimingMapSettings s;
  s.axes = {{900.0, 1500.0, 3000.0}, {6.0, 12.0, 20.0, 40.0}};
  for (const double speed : s.axes[0]) {
    for (const double fuel : s.axes[1])
      s.values_cad.push_back(filled ? plane(speed, fuel) : 0.0);
  }
  s.forgetting = forgetting;
  return s;
}

// At a cell alone, the weighted mean of prior and observations: s^2/n after many.
TEST(TimingMap, ACellLearnsTheMeanOfItsOptima) {
  TimingMap map(uneven(false));
  const std::array at{1500.0, 20.0};
  double sum = 0.0;
  for (int k = 1; k <= 50; ++k) {
    const double y = -6.0 + 0.5 * random::normal(3, 1, static_cast<std::uint64_t>(k));
    sum += y;
    ASSERT_TRUE(map.learn(at, y, 0.5));
    const double information = 1.0 / 9.0 + k / 0.25;
    EXPECT_NEAR(map.lookup(at).value_cad, sum / 0.25 / information, 1e-9);
    EXPECT_NEAR(map.lookup(at).sd_cad, 1.0 / std::sqrt(information), 1e-12);
    EXPECT_NEAR(map.lookup(at).support, k, 1e-12);
  }
  for (const double other : {6.0, 12.0, 40.0}) {
    EXPECT_EQ(map.lookup(std::array{1500.0, other}).value_cad, 0.0);
    EXPECT_EQ(map.lookup(std::array{1500.0, other}).support, 0.0);
  }
}

TEST(TimingMap, AnOptimumBetweenCellsTeachesTheNearOnesMost) {
  TimingMap map(uneven(false));
  map.learn(std::array{1400.0, 18.0}, -5.0, 0.1);
  const std::vector<double>& v = map.values_cad();  // rows of four
  EXPECT_LT(v[1 * 4 + 2], v[1 * 4 + 1]);
  EXPECT_LT(v[1 * 4 + 1], v[0 * 4 + 1]);
  EXPECT_LT(v[0 * 4 + 1], 0.0);
  EXPECT_EQ(v[2 * 4 + 2], 0.0);
  double support = 0.0;
  for (const double s : map.support())
    support += s;
  EXPECT_NEAR(support, 1.0, 1e-12);
}

TEST(TimingMap, ForgetsAsItIsTold) {
  const std::array at{1500.0, 20.0};
  TimingMap forgets(uneven(false, 0.8)), keeps(uneven(false, 1.0));
  for (const double y : {-6.0, -2.0}) {
    for (int k = 0; k < 60; ++k) {
      for (TimingMap* map : {&forgets, &keeps})
        map->learn(at, y, 0.5);
    }
  }
  EXPECT_NEAR(forgets.lookup(at).value_cad, -2.0, 0.01);
  EXPECT_NEAR(keeps.lookup(at).value_cad, -4.0, 0.05);
  EXPECT_NEAR(forgets.lookup(at).support, 5.0, 0.01);  // 1/(1 - 0.8)
  EXPECT_GT(forgets.lookup(at).sd_cad, keeps.lookup(at).sd_cad);
}

TEST(TimingMap, NeverKnowsLessThanAtTheStart) {
  TimingMap map(uneven(false, 0.5));
  const std::array at{1500.0, 20.0};
  for (int k = 0; k < 20; ++k)
    map.learn(at, -6.0, 50.0);
  EXPECT_LE(map.lookup(at).sd_cad, 3.0);
}

TEST(TimingMap, RefusesWhatIsNoConfirmedOptimumAndChangesNothing) {
  TimingMap map(uneven(true));
  const StateColumns before = save_state(map);
  for (const auto& [speed, fuel, y, sd] : {std::array{3001.0, 20.0, -5.0, 0.5},
                                           {1500.0, 5.9, -5.0, 0.5},
                                           {nan, 20.0, -5.0, 0.5},
                                           {1500.0, 20.0, nan, 0.5},
                                           {1500.0, 20.0, -5.0, 0.0},
                                           {1500.0, 20.0, -5.0, nan}}) {
    EXPECT_FALSE(map.learn(std::array{speed, fuel}, y, sd));
  }
  StateColumns bad = before;
  bad["variance"][3] = 0.0;
  EXPECT_THROW(restore_state(map, bad), ParameterError);
  EXPECT_EQ(save_state(map), before);
}

TEST(TimingMap, LooksUpAndLearnsWithoutAllocating) {
  TimingMap map(uneven(true));
  const std::array at{1400.0, 18.0};
  static_assert(noexcept(map.lookup(at)) && noexcept(map.learn(at, 0.0, 1.0)));
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 100; ++k) {
    map.learn(at, -0.01 * k, 0.3);
    map.lookup(at);
  }
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::guide
