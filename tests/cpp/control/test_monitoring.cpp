// What monitors of a throttle share: times in samples, ages, two sensors, a plate that stands still.
#include "mgdd/control/monitoring.hpp"

#include <limits>

#include <gtest/gtest.h>

namespace mgdd::control {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

TEST(Monitoring, ATimeOfWholeSamplesLastsThatManyWhateverTheRounding) {
  for (const double sample_s : {1e-3, 7e-4, 0.3}) {
    for (int n = 1; n <= 400; ++n) {
      ASSERT_TRUE(lasted(n, sample_s, n * sample_s)) << n;
      ASSERT_FALSE(lasted(n - 1, sample_s, n * sample_s)) << n;
      ASSERT_FALSE(older(n * sample_s, n * sample_s, sample_s)) << n;
      ASSERT_TRUE(older((n + 1) * sample_s, n * sample_s, sample_s)) << n;
    }
  }
  EXPECT_TRUE(older(inf, 1.0, 0.1));
}

TEST(Monitoring, SilenceGrowsWithTheSamplesUntilAnAgeIsTold) {
  double age_s = 0.5;
  age_s = aged(false, nan, age_s, 0.25);
  EXPECT_EQ(age_s, 0.75);
  age_s = aged(true, 0.125, age_s, 0.25);
  EXPECT_EQ(age_s, 0.125);
}

TEST(Monitoring, APairIsHealthyInRangeAndWithinTheTolerance) {
  const Domain range = closed(0.2, 4.6);
  EXPECT_TRUE(check_pair({0.2, 4.6}, range, 0.0, 0.1).healthy());
  EXPECT_FALSE(check_pair({1.0, 2.0}, range, -0.1, 0.1).agree);
  EXPECT_TRUE(check_pair({1.0, 2.0}, range, -0.0999, 0.1).healthy());
  for (const double wrong : {0.1999, 4.6001, nan, inf}) {
    const PairCheck first = check_pair({wrong, 1.0}, range, 0.0, 0.1);
    EXPECT_FALSE(first.healthy());
    EXPECT_EQ(first.usable(), 1u);
    const PairCheck second = check_pair({1.0, wrong}, range, 0.0, 0.1);
    EXPECT_FALSE(second.healthy());
    EXPECT_EQ(second.usable(), 0u);
    EXPECT_EQ(check_pair({wrong, wrong}, range, 0.0, 0.1).usable(), 0u);
  }
  EXPECT_FALSE(check_pair({1.0, 2.0}, range, nan, 0.1).agree);
}

TEST(Monitoring, AStandstillStartsAnewWhereThePlateMovesOrIsExcused) {
  double anchor_deg = 10.0, samples = 7.0;
  follow_standstill(false, 10.5, 0.5, anchor_deg, samples);
  EXPECT_EQ(samples, 7.0);
  EXPECT_EQ(anchor_deg, 10.0);  // a creep is not followed
  follow_standstill(false, 9.4, 0.5, anchor_deg, samples);
  EXPECT_EQ(samples, 0.0);
  EXPECT_EQ(anchor_deg, 9.4);
  samples = 3.0;
  follow_standstill(true, 9.5, 0.5, anchor_deg, samples);
  EXPECT_EQ(samples, 0.0);
  EXPECT_EQ(anchor_deg, 9.5);
}

}  // namespace
}  // namespace mgdd::control
