// exp, log and powers without branches against the standard library, over their whole stated range.
#include "mgdd/math/lane_functions.hpp"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace mgdd {
namespace {

TEST(LaneFunctions, FourFifthsOverAHundredOctaves) {
  for (int i = -5000; i <= 5000; ++i) {
    const double x = std::exp2(0.01 * i + 0.0037);
    // (x^(4/5) / x)^5 x = 1, whatever the rounding of 0.8.
    const double root = lane_four_fifths(x) / x;
    EXPECT_NEAR(root * root * root * root * root * x, 1.0, 1e-14) << x;
    EXPECT_NEAR(inverse_fifth_root_guess(x) * std::pow(x, 0.2), 1.0, 0.04) << x;
    EXPECT_NEAR(inverse_fifth_root_first(x, inverse_fifth_root_guess(x)) * std::pow(x, 0.2), 1.0, 3e-7) << x;
  }
  EXPECT_EQ(lane_four_fifths(0.0), 0.0);
  EXPECT_NEAR(lane_four_fifths(32.0), 16.0, 1e-14);
  EXPECT_TRUE(std::isnan(lane_four_fifths(std::numeric_limits<double>::quiet_NaN())));
}

TEST(LaneFunctions, ExponentialAndLogarithm) {
  for (int i = -6990; i <= 6990; ++i) {
    const double x = 0.1 * i + 0.013;
    EXPECT_NEAR(lane_exp(x) / std::exp(x), 1.0, 5e-16) << x;
    const double y = std::exp(x);
    EXPECT_NEAR(lane_log(y), std::log(y), 4e-16 * std::fmax(1.0, std::abs(x))) << y;
  }
  EXPECT_EQ(lane_exp(0.0), 1.0);
  EXPECT_EQ(lane_log(1.0), 0.0);
  EXPECT_EQ(lane_exp(-1e9), lane_exp(-700.0));
  EXPECT_EQ(lane_exp(1e9), lane_exp(700.0));
  EXPECT_TRUE(std::isnan(lane_exp(std::numeric_limits<double>::quiet_NaN())));
}

}  // namespace
}  // namespace mgdd
