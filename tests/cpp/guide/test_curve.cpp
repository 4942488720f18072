// A guide's curve: cubics are reproduced, the ends go on straight, bad points change nothing.
#include "mgdd/guide/curve.hpp"

#include <vector>

#include <gtest/gtest.h>

#include "support/no_alloc.hpp"

namespace mgdd::guide {
namespace {

double hill(double x) {
  return 3.0 - 0.04 * (x - 2.5) * (x - 2.5);
}

std::vector<double> of(double (*f)(double), const std::vector<double>& inputs) {
  std::vector<double> out;
  for (const double x : inputs)
    out.push_back(f(x));
  return out;
}

const std::vector<double> uneven{-11.0, -7.0, -6.5, -1.0, 0.0, 4.0, 9.0, 17.0};

TEST(Curve, ReproducesAParabolaFromUnevenPoints) {
  const Curve curve(uneven, of(hill, uneven));
  for (double x = -11.0; x <= 17.0; x += 0.37)
    EXPECT_NEAR(curve(x), hill(x), 4e-5) << x;  // the table is linear between its nodes
  EXPECT_NEAR(curve.best(), 2.5, 1e-6);
  EXPECT_NEAR(curve.top(), 3.0, 2e-5);
  EXPECT_NEAR(curve.curvature(3.0), -0.08, 1e-4);
  EXPECT_TRUE(curve.has_maximum());
  EXPECT_DOUBLE_EQ(curve.lower(), -11.0);
  EXPECT_NEAR(curve.upper(), 17.0, 1e-12);
}

TEST(Curve, PassesThroughItsPointsAndNeverFarBetweenThem) {
  const auto kinked = [](double x) { return x < 1.0 ? 0.2 * x : 0.2 - 1.5 * (x - 1.0); };
  const std::vector<double> inputs{-9.0, -4.0, 1.0, 6.0, 11.0, 30.0};
  std::vector<double> values;
  for (const double x : inputs)
    values.push_back(kinked(x));
  const Curve curve(inputs, values);
  for (std::size_t i = 0; i < inputs.size(); ++i)
    EXPECT_NEAR(curve(inputs[i]), values[i], 0.06) << i;
}

TEST(Curve, GoesOnStraightBeyondItsEnds) {
  const Curve curve(uneven, of(hill, uneven));
  const double slope = -0.08 * (17.0 - 2.5);
  EXPECT_NEAR(curve(27.0), hill(17.0) + 10.0 * slope, 0.03);
  EXPECT_NEAR(curve(-21.0) - curve(-16.0), curve(-16.0) - curve(-11.0), 1e-9);
}

TEST(Curve, AMaximumAtAnEndIsNone) {
  const std::vector<double> inputs{0.0, 1.0, 2.0, 4.0};
  EXPECT_FALSE(Curve(inputs, std::vector{0.0, 1.0, 2.0, 4.0}).has_maximum());
  EXPECT_DOUBLE_EQ(Curve(inputs, std::vector{4.0, 1.0, 0.0, -1.0}).best(), 0.0);
}

TEST(Curve, RisesAgainByAsMuchAsItsOtherMaximumStandsOut) {
  const std::vector<double> x{0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  EXPECT_LT(Curve(x, std::vector{1.0, 4.0, 6.0, 5.0, 3.0, 2.0, 0.0}).rises_again(9.0), 0.01);
  EXPECT_NEAR(Curve(x, std::vector{1.0, 4.0, 10.0, 5.0, 0.0, 6.0, 2.0}).rises_again(9.0), 0.6, 0.05);
  EXPECT_NEAR(Curve(x, std::vector{2.0, 6.0, 0.0, 5.0, 10.0, 4.0, 1.0}).rises_again(9.0), 0.6, 0.05);
  EXPECT_EQ(Curve(x, std::vector{2.0, 6.0, 0.0, 5.0, 10.0, 4.0, 1.0}).rises_again(1.9), 0.0);
}

TEST(Curve, OtherPointsCostNoAllocation) {
  Curve curve;
  const std::vector<double> values = of(hill, uneven);
  const test_support::AllocationCounter counter;
  EXPECT_TRUE(curve.put(uneven, values));
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_EQ(curve, Curve(uneven, values));
  static_assert(noexcept(curve.put(uneven, values)) && noexcept(curve(1.0)));
}

}  // namespace
}  // namespace mgdd::guide
