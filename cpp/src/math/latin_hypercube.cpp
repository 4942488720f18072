#include "mgdd/math/latin_hypercube.hpp"

#include <numeric>
#include <utility>
#include <vector>

#include "mgdd/common/random.hpp"

namespace mgdd {

Eigen::MatrixXd latin_hypercube(std::size_t points, std::size_t columns, std::uint64_t seed) {
  Eigen::MatrixXd cube(static_cast<Eigen::Index>(points), static_cast<Eigen::Index>(columns));
  std::vector<std::size_t> cell(points);
  for (std::size_t j = 0; j < columns; ++j) {
    std::iota(cell.begin(), cell.end(), std::size_t{0});
    for (std::size_t i = points; i > 1; --i) {  // Fisher and Yates; std::shuffle differs between libraries
      const auto other = static_cast<std::size_t>(random::uniform(seed, 2 * j, i) * static_cast<double>(i));
      std::swap(cell[i - 1], cell[other]);
    }
    for (std::size_t i = 0; i < points; ++i) {
      cube(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          (static_cast<double>(cell[i]) + random::uniform(seed, 2 * j + 1, i)) / static_cast<double>(points);
    }
  }
  return cube;
}

}  // namespace mgdd
