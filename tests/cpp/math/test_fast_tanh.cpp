#include "mgdd/math/fast_tanh.hpp"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace mgdd {
namespace {

TEST(FastTanh, AgreesWithTheLibraryFromTinyToSaturated) {
  double worst = 0.0;
  for (int i = 0; i <= 200'000; ++i) {
    const double x = std::exp(-40.0 + 45.0 * i / 200'000.0);
    const double expected = static_cast<double>(std::tanh(static_cast<long double>(x)));
    worst = std::max(worst, std::abs(fast_tanh(x) - expected) / expected);
    ASSERT_EQ(fast_tanh(-x), -fast_tanh(x));
  }
  EXPECT_LT(worst, 2e-15);
}

TEST(FastTanh, LimitsAndNaN) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(fast_tanh(0.0), 0.0);
  EXPECT_EQ(fast_tanh(infinity), 1.0);
  EXPECT_EQ(fast_tanh(-infinity), -1.0);
  EXPECT_TRUE(std::isnan(fast_tanh(std::numeric_limits<double>::quiet_NaN())));
}

}  // namespace
}  // namespace mgdd
