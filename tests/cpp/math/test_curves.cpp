// Curves between their nodes: cubics, and the argument of a monotone function.
#include "mgdd/math/cubic_weights.hpp"
#include "mgdd/math/monotone_inverse.hpp"
#include "support/test.hpp"

namespace mgdd {
namespace {

const std::vector<double> uneven{-3.0, -2.5, -1.0, 0.25, 1.0, 2.75, 3.0};

std::vector<double> sampled(double (*f)(double)) {
  std::vector<double> y;
  for (const double x : uneven)
    y.push_back(f(x));
  return y;
}

TEST(CubicWeights, ACubicComesBackWithItsSlope) {
  const auto y = sampled([](double x) { return 2.0 - x + 0.5 * x * x - 0.3 * x * x * x; });
  for (double at = -2.5; at < 2.75; at += 0.0625) {
    const CubicWeights w = cubic_weights(uneven, interval_of(uneven, at), at);
    EXPECT_NEAR(w.value_of(y), 2.0 - at + 0.5 * at * at - 0.3 * at * at * at, 1e-12) << at;
    EXPECT_NEAR(w.slope_of(y), -1.0 + at - 0.9 * at * at, 1e-12) << at;
  }
}

TEST(CubicWeights, AParabolaComesBackEverywhereAndBeyond) {
  const auto y = sampled([](double x) { return 1.0 + 3.0 * x - 0.7 * x * x; });
  for (const double at : {-3.5, -2.9, -0.4, 2.9, 3.5}) {
    const CubicWeights w = cubic_weights(uneven, interval_of(uneven, at), at);
    EXPECT_NEAR(w.value_of(y), 1.0 + 3.0 * at - 0.7 * at * at, 1e-12);
    EXPECT_NEAR(w.slope_of(y), 3.0 - 1.4 * at, 1e-12);
  }
}

TEST(CubicWeights, NodesAreExact) {
  const auto y = sampled([](double x) { return std::sin(x) + 1e3; });
  for (std::size_t k = 0; k < uneven.size(); ++k)
    EXPECT_EQ(cubic_weights(uneven, interval_of(uneven, uneven[k]), uneven[k]).value_of(y), y[k]);
}

TEST(CubicWeights, IntervalsHoldTheirPlace) {
  EXPECT_EQ(interval_of(uneven, -9.0), 0u);
  EXPECT_EQ(interval_of(uneven, -3.0), 0u);
  EXPECT_EQ(interval_of(uneven, 0.25), 3u);
  EXPECT_EQ(interval_of(uneven, 0.9), 3u);
  EXPECT_EQ(interval_of(uneven, 3.0), 5u);
  EXPECT_EQ(interval_of(uneven, 9.0), 5u);
}

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
