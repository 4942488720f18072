// Tables: exact at the nodes, linear and bilinear between them, the edge outside, axes that cannot be; and the inverse
// of a function that does not fall.
#include "mgdd/math/tables.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/math/monotone_inverse.hpp"

namespace mgdd {
namespace {

const std::vector<double> rows{-1.0, 0.5, 4.0};
const std::vector<double> columns{10.0, 11.0, 13.0, 20.0};

TEST(Tables, APlaneIsBilinearAndHeldAtItsEdges) {
  const auto f = [](double x, double y) { return 2.0 - 3.0 * x + 0.7 * y + 0.11 * x * y; };
  std::vector<double> cells;
  for (const double x : rows) {
    for (const double y : columns)
      cells.push_back(f(x, y));
  }
  for (const double x : {-1.0, -0.3, 0.5, 2.9, 4.0}) {
    for (const double y : {10.0, 10.9, 11.0, 12.4, 19.0, 20.0}) {
      const auto place = place_in(rows, columns, x, y);
      EXPECT_NEAR(place.value_of(cells), f(x, y), 1e-13);
      EXPECT_FALSE(place.outside);
    }
  }
  EXPECT_NEAR(place_in(rows, columns, 9.0, 5.0).value_of(cells), f(4.0, 10.0), 1e-13);
  EXPECT_TRUE(place_in(rows, columns, 2.0, 20.1).outside);
  EXPECT_TRUE(place_in(rows, columns, -1.1, 12.0).outside);
}

TEST(Tables, ALineIsExactAtItsNodes) {
  const std::vector<double> values{3.7, -1.9, 8.3, 8.3};
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_EQ(place_in(columns, columns[i]).value_of(values), values[i]);
  EXPECT_NEAR(place_in(columns, 12.5).value_of(values), -1.9 + 0.75 * 10.2, 1e-14);
  EXPECT_EQ(place_in(columns, 1e9).value_of(values), 8.3);
}

TEST(Tables, AnAxisThatCannotBeIsRefusedByName) {
  const auto field_of = [](const std::vector<double>& axis) -> std::string {
    try {
      require_axis("speed_rpm", axis);
    } catch (const Error& error) {
      return error.field;
    }
    return "";
  };
  EXPECT_EQ(field_of({800.0}), "speed_rpm");
  EXPECT_EQ(field_of({800.0, 900.0, 900.0}), "speed_rpm[2]");
  EXPECT_EQ(field_of({800.0, std::numeric_limits<double>::quiet_NaN()}), "speed_rpm[1]");
  EXPECT_EQ(field_of(columns), "");
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
