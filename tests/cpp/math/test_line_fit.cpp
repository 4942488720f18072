// Statistics: lines through points, the time of an autocorrelation, points of a Latin hypercube.
#include <set>

#include "mgdd/common/random.hpp"
#include "mgdd/math/autocorrelation.hpp"
#include "mgdd/math/latin_hypercube.hpp"
#include "mgdd/math/line_fit.hpp"
#include "support/test.hpp"

namespace mgdd {
namespace {

TEST(LineFit, IsExactOnALineWhateverTheWeights) {
  LineFit line;
  for (const double x : {-3.0, 0.5, 2.0, 7.0})
    line.add(x, 4.0 - 2.5 * x, 1.0 + x * x);
  EXPECT_NEAR(line.slope(), -2.5, 1e-12);
  EXPECT_NEAR(line.intercept(), 4.0, 1e-12);
}

// Points (0, 1), (1, 0), (3, 5): means 4/3 and 2, sums of products 7 and of squares 14/3, slope 3/2. A weight of 2 is
// the point twice.
TEST(LineFit, MinimisesTheSquares) {
  LineFit line, weighted, twice;
  for (const auto& [x, y] : {std::pair{0.0, 1.0}, std::pair{1.0, 0.0}, std::pair{3.0, 5.0}})
    line.add(x, y);
  EXPECT_NEAR(line.slope(), 1.5, 1e-12);
  EXPECT_NEAR(line.intercept(), 0.0, 1e-12);
  weighted.add(0.0, 1.0, 2.0), twice.add(0.0, 1.0), twice.add(0.0, 1.0);
  weighted.add(1.0, 0.0), twice.add(1.0, 0.0);
  weighted.add(3.0, 5.0), twice.add(3.0, 5.0);
  EXPECT_DOUBLE_EQ(weighted.slope(), twice.slope());
  line.add(9.0, -40.0);
  line.add(9.0, -40.0, -1.0);
  EXPECT_NEAR(line.slope(), 1.5, 1e-12);
}

double mean_time(double rho, std::size_t n) {
  double sum = 0.0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    std::vector<double> r(n);
    for (std::size_t i = 0; i < n; ++i) {
      const double own = random::normal(seed, 3, i);
      r[i] = i == 0 ? own : rho * r[i - 1] + std::sqrt(1.0 - rho * rho) * own;
    }
    sum += autocorrelation_time(r) / 100.0;
  }
  return sum;
}

TEST(Autocorrelation, TimeOfFirstOrderSequences) {
  EXPECT_NEAR(mean_time(0.0, 2000), 1.0, 0.1);
  EXPECT_NEAR(mean_time(0.5, 2000), 3.0, 0.3);
  EXPECT_NEAR(mean_time(0.9, 4000), 19.0, 2.0);
  EXPECT_NEAR(mean_time(-0.6, 500), 1.0, 1e-9);  // never better than independent
}

TEST(Autocorrelation, EdgesAreFinite) {
  EXPECT_EQ(autocorrelation_time({}), 1.0);
  EXPECT_EQ(autocorrelation_time(std::vector<double>(50, 0.0)), 1.0);
  EXPECT_EQ(autocorrelation_time(std::vector<double>{2.0}), 1.0);
  EXPECT_GT(autocorrelation_time(std::vector<double>(50, 1.0)), 20.0);  // an offset is one sample
}

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
