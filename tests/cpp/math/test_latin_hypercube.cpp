#include "mgdd/math/latin_hypercube.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace mgdd {
namespace {

TEST(LatinHypercube, HasOnePointInEveryCellOfEveryColumn) {
  for (const std::size_t points : {1u, 2u, 17u, 200u}) {
    const Eigen::MatrixXd cube = latin_hypercube(points, 5, 3);
    ASSERT_EQ(cube.rows(), static_cast<Eigen::Index>(points));
    for (const auto& column : cube.colwise()) {
      std::set<double> cells;
      for (const double share : column) {
        EXPECT_GT(share, 0.0);
        EXPECT_LT(share, 1.0);
        cells.insert(std::floor(share * static_cast<double>(points)));
      }
      EXPECT_EQ(cells.size(), points);
    }
  }
  EXPECT_EQ(latin_hypercube(0, 3, 1).rows(), 0);
}

TEST(LatinHypercube, FollowsItsSeedAndKeepsItsColumns) {
  const Eigen::MatrixXd cube = latin_hypercube(20, 3, 7);
  EXPECT_EQ(latin_hypercube(20, 3, 7), cube);
  EXPECT_EQ(latin_hypercube(20, 5, 7).leftCols(3), cube);
  EXPECT_NE(latin_hypercube(20, 3, 8), cube);
  EXPECT_NE(cube.col(0), cube.col(1));
}

TEST(LatinHypercube, FillsItsCellsEvenly) {
  const Eigen::MatrixXd cube = latin_hypercube(4000, 2, 11);
  EXPECT_NEAR(cube.mean(), 0.5, 1e-4);
  const Eigen::VectorXd within = (cube.col(0) * 4000.0).array() - (cube.col(0) * 4000.0).array().floor();
  EXPECT_NEAR(within.mean(), 0.5, 0.02);
  const Eigen::ArrayXd a = cube.col(0).array() - 0.5, b = cube.col(1).array() - 0.5;
  EXPECT_NEAR((a * b).mean() * 12.0, 0.0, 0.05) << "columns are independent";
}

}  // namespace
}  // namespace mgdd
