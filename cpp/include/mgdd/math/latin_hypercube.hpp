// Latin hypercube (McKay, Beckman and Conover 1979) of counter-based random numbers: the same seed gives the same
// points on every machine. Dimensionless. Not real-time safe (allocates).
#pragma once

#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace mgdd {

/// `points` rows of numbers in (0, 1), one per cell of width 1/points in every column, at random within it. A column
/// does not depend on the number of columns.
Eigen::MatrixXd latin_hypercube(std::size_t points, std::size_t columns, std::uint64_t seed);

}  // namespace mgdd
