// Laws of the cubic weights: polynomials come back with their slope, nodes come back to the bit.
#include "mgdd/math/cubic_weights.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace mgdd
