// Tables and curves between their nodes: maps of one and two axes, cubics, and the argument of a monotone function.
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/math/cubic_weights.hpp"
#include "mgdd/math/lookup_table.hpp"
#include "mgdd/math/monotone_inverse.hpp"
#include "support/no_alloc.hpp"

namespace mgdd {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();
const TableAxis speed{"speed_rpm", {800.0, 1500.0, 3100.0}};
const TableAxis fuel{"fuel_mg", {5.0, 11.0, 13.0, 20.0, 40.0}};

double f(double n, double m) {
  return 3.0 - 0.002 * n + 0.7 * m + 1.3e-4 * n * m;
}

std::vector<double> cells() {
  std::vector<double> out;
  for (const double n : speed.entries) {
    for (const double m : fuel.entries)
      out.push_back(f(n, m));
  }
  return out;
}

LookupTable<2> plane() {
  return {{speed, fuel}, cells()};
}

TEST(LookupTable, HoldsABilinearFunctionExactly) {
  const LookupTable<2> table = plane();
  for (const double n : {800.0, 1499.9, 1500.0, 2222.0, 3100.0}) {
    for (const double m : {5.0, 10.9, 11.0, 12.4, 39.0, 40.0}) {
      const TableValue found = table.at(n, m);
      EXPECT_NEAR(found.value, f(n, m), 1e-12 * std::abs(f(n, m)));
      EXPECT_FALSE(found.held_outside);
    }
  }
  EXPECT_EQ(table.at(1500.0, 13.0).value, f(1500.0, 13.0));
}

TEST(LookupTable, HoldsEveryEdgeAndCornerAndSaysSo) {
  const LookupTable<2> table = plane();
  const auto expect = [&](double n, double m, double at_n, double at_m) {
    const TableValue found = table.at(n, m);
    EXPECT_TRUE(found.held_outside) << n << ", " << m;
    EXPECT_NEAR(found.value, f(at_n, at_m), 1e-12);
  };
  expect(100.0, 12.0, 800.0, 12.0);
  expect(9000.0, 12.0, 3100.0, 12.0);
  expect(2000.0, 1.0, 2000.0, 5.0);
  expect(2000.0, 41.0, 2000.0, 40.0);
  expect(100.0, 1.0, 800.0, 5.0);
  expect(100.0, 99.0, 800.0, 40.0);
  expect(9000.0, 1.0, 3100.0, 5.0);
  expect(inf, -inf, 3100.0, 5.0);
}

TEST(LookupTable, ALineOfOneAxis) {
  const LookupTable<1> line({fuel}, {1.0, -2.0, 4.0, 4.0, 0.5});
  EXPECT_EQ(line.at(13.0).value, 4.0);
  EXPECT_NEAR(line.at(12.5).value, -2.0 + 0.75 * 6.0, 1e-14);
  EXPECT_FALSE(line.at(40.0).held_outside);
  EXPECT_TRUE(line.at(40.5).held_outside);
  EXPECT_EQ(line.at(1e9).value, 0.5);
  EXPECT_EQ(line.at(std::array{5.0}).value, 1.0);
}

TEST(LookupTable, AMissingCellSpoilsOnlyWhatItHasPartIn) {
  std::vector<double> holed = cells();
  holed[1 * fuel.entries.size() + 2] = nan;  // 1500 rpm, 13 mg
  const LookupTable<2> table({speed, fuel}, holed);
  EXPECT_TRUE(std::isnan(table.at(1500.0, 13.0).value));
  EXPECT_TRUE(std::isnan(table.at(1400.0, 12.0).value));
  EXPECT_TRUE(std::isnan(table.at(1600.0, 19.0).value));
  EXPECT_FALSE(table.at(1600.0, 19.0).held_outside);
  EXPECT_EQ(table.at(1500.0, 11.0).value, f(1500.0, 11.0));  // a cell beside it
  EXPECT_NEAR(table.at(1150.0, 11.0).value, f(1150.0, 11.0), 1e-12);
  EXPECT_NEAR(table.at(800.0, 13.0).value, f(800.0, 13.0), 1e-12);
}

TEST(LookupTable, NanIsNotAPoint) {
  const LookupTable<2> table = plane();
  for (const auto& point : {std::array{nan, 12.0}, {1500.0, nan}, {nan, nan}}) {
    EXPECT_TRUE(std::isnan(table.at(point).value));
    EXPECT_TRUE(table.at(point).held_outside);
  }
  EXPECT_TRUE(std::isnan(LookupTable<1>({fuel}, {1.0, 2.0, 3.0, 4.0, 5.0}).at(nan).value));
}

template <class Make>
std::string field_of(Make make) {
  try {
    make();
  } catch (const Error& error) {
    return error.field;
  }
  return "";
}

TEST(LookupTable, RefusesByName) {
  EXPECT_EQ(field_of([] { LookupTable<1>({TableAxis{"fuel_mg", {5.0}}}, {1.0}); }), "fuel_mg");
  EXPECT_EQ(field_of([] { LookupTable<1>({TableAxis{"fuel_mg", {5.0, 7.0, 7.0}}}, {1.0, 2.0, 3.0}); }), "fuel_mg[2]");
  EXPECT_EQ(field_of([] { LookupTable<1>({TableAxis{"fuel_mg", {5.0, nan}}}, {1.0, 2.0}); }), "fuel_mg[1]");
  EXPECT_EQ(field_of([] { LookupTable<2>({speed, TableAxis{"fuel_mg", {7.0, 5.0}}}, cells()); }), "fuel_mg[1]");
  EXPECT_EQ(field_of([] { LookupTable<2>({fuel, speed}, {1.0, 2.0}); }), "values");
  EXPECT_EQ(field_of([] { LookupTable<1>({TableAxis{"fuel_mg", {5.0, 7.0}}}, {1.0, inf}); }), "values[1]");
}

TEST(LookupTable, IsRealTimeSafe) {
  const LookupTable<2> table = plane();
  const LookupTable<1> line({fuel}, {1.0, -2.0, 4.0, 4.0, 0.5});
  static_assert(noexcept(table.at(1.0, 2.0)));
  static_assert(noexcept(line.at(1.0)));
  const test_support::AllocationCounter counter;
  double sum = 0.0;
  for (int i = 0; i < 1000; ++i)
    sum += table.at(700.0 + 3.0 * i, 0.05 * i).value + line.at(0.05 * i).value;
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(std::isfinite(sum));
}

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
