// Many starts: one point per cell of every axis, the ranking of what came of them, and whose exception comes back.
#include "mgdd/optimize/least_squares/multi_start.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

namespace mgdd::optimize {
namespace {

TEST(SpreadStarts, HasOnePointPerCellOfEveryAxis) {
  const std::vector<Parameter> box{{"a", -1.0, 3.0}, {"b", 1e-3, 10.0, true}};
  const auto points = spread_starts(box, 16, 5);
  std::array<int, 16> a{}, b{};
  for (const Eigen::VectorXd& point : points) {
    ++a[static_cast<std::size_t>(16.0 * (point[0] + 1.0) / 4.0)];
    ++b[static_cast<std::size_t>(16.0 * std::log(point[1] / 1e-3) / std::log(1e4))];
  }
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(a[i], 1);
    EXPECT_EQ(b[i], 1);
  }
  EXPECT_EQ(spread_starts(box, 16, 5)[3], points[3]);
  EXPECT_NE(spread_starts(box, 16, 6)[3], points[3]);
  EXPECT_THROW((void)spread_starts({{"a"}}, 4, 1), ParameterError);
}

FitReport with_cost(double cost, double rmse) {
  FitReport report;
  report.cost = cost;
  report.rmse = rmse;
  return report;
}

TEST(Rank, TakesTheLowestCostAndCountsWhoReachedIt) {
  const MultiStartFit fit =
      rank({with_cost(9.0, 3.0), with_cost(4.0, 2.0), with_cost(4.03, 2.0099), with_cost(4.1, 2.0101)});
  EXPECT_EQ(fit.best, 1U);
  EXPECT_EQ(fit.n_reached, 2U);
  EXPECT_EQ(fit.reports.size(), 4U);
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::nan("");
  EXPECT_EQ(rank({with_cost(nan, nan), with_cost(5.0, 1.0)}).best, 1U);
  EXPECT_EQ(rank({with_cost(infinity, infinity), with_cost(5.0, 1.0), with_cost(nan, nan)}).best, 1U);
  EXPECT_EQ(rank({with_cost(5.0, 1.0), with_cost(5.0, 1.0)}).best, 0U) << "the first of equals";
}

TEST(MultiStart, KeepsTheOrderOfItsStartsOnAnyNumberOfThreads) {
  std::vector<Eigen::VectorXd> starts;
  for (int i = 0; i < 12; ++i)
    starts.push_back(Eigen::VectorXd::Constant(1, 20.0 - i));
  for (const std::size_t threads : {1U, 3U}) {
    const MultiStartFit fit =
        multi_start(starts, [](const Eigen::VectorXd& start) { return with_cost(start[0], start[0]); }, threads);
    ASSERT_EQ(fit.reports.size(), 12U);
    for (std::size_t i = 0; i < 12; ++i)
      EXPECT_EQ(fit.reports[i].cost, 20.0 - static_cast<double>(i));
    EXPECT_EQ(fit.best, 11U);
  }
}

}  // namespace
}  // namespace mgdd::optimize
