// The least-squares line: by hand, and exact on a line.
#include "mgdd/math/line_fit.hpp"

#include <utility>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace mgdd
