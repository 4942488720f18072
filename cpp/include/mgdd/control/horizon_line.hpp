// Numbers along a horizon: an array where its length N is known to the compiler, a vector that is sized once where it
// is told at run time (N = Eigen::Dynamic). The array never touches the heap; the vector does where it is sized or
// copied.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace mgdd::control {

template <class X, int N>
using Along = std::conditional_t<N == Eigen::Dynamic, std::vector<X>, std::array<X, static_cast<std::size_t>(N)>>;

/// Sizes a line of run-time length; an array has its length.
template <class Line>
void stretch(Line& line, std::size_t length) {
  if constexpr (requires { line.resize(length); }) line.resize(length);
}

/// Zero, or empty where the size comes at run time.
template <class Matrix>
Matrix zero_or_empty() {
  if constexpr (Matrix::SizeAtCompileTime == Eigen::Dynamic) {
    return {};
  } else {
    return Matrix::Zero();
  }
}

}  // namespace mgdd::control
