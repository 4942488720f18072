// The inverse of a function that does not fall.
#include "mgdd/math/monotone_inverse.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace mgdd {
namespace {

TEST(MonotoneInverse, FindsTheSmallestArgument) {
  const auto cube = [](double x) noexcept { return x * x * x; };
  EXPECT_NEAR(monotone_inverse(cube, 7.0, 0.0, 5.0), std::cbrt(7.0), 1e-12);
  const auto stairs = [](double x) noexcept { return std::floor(x); };
  EXPECT_NEAR(monotone_inverse(stairs, 3.0, 0.0, 10.0), 3.0, 2e-12);
  EXPECT_NEAR(monotone_inverse(stairs, 2.5, 0.0, 10.0), 3.0, 2e-12);
  EXPECT_GE(stairs(monotone_inverse(stairs, 2.5, 0.0, 10.0)), 2.5);  // from above
  EXPECT_EQ(monotone_inverse(stairs, -1.0, 0.0, 10.0), 0.0);
  EXPECT_EQ(monotone_inverse(stairs, 99.0, 0.0, 10.0), 10.0);
  EXPECT_EQ(monotone_inverse(stairs, 10.0, 0.0, 10.0), 10.0);
}

TEST(MonotoneInverse, IsQuickOnSmoothFunctionsAndNeverMuchSlowerThanBisection) {
  int calls = 0;
  const auto counted = [&](const auto& f) {
    return [&calls, &f](double x) {
      ++calls;
      return f(x);
    };
  };
  const auto smooth = [](double x) { return std::expm1(x) + 0.2 * x; };
  (void)monotone_inverse(counted(smooth), 1.7, 0.0, 3.0);
  EXPECT_LE(calls, 14);
  // A cliff between a plain and a high plateau: nothing to interpolate.
  const auto cliff = [](double x) { return x < 0.71234567 ? 1e-9 * x : 1e9; };
  calls = 0;
  EXPECT_NEAR(monotone_inverse(counted(cliff), 1.0, 0.0, 1.0), 0.71234567, 2e-13);
  EXPECT_LE(calls, 48);  // log2(1e13) = 43.2, the ends, one to spare
}

}  // namespace
}  // namespace mgdd
