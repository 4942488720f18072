// Forward sensitivities of a run: the model on dual numbers, as many directions per pass as its scalar has lanes.
// noexcept, heap-free. Source: Griewank and Walther 2008, chapter 3.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::dynamics {

/// A number as the scalar of a pass: lane i of the pass carries direction first + i. On a plain scalar, the number.
template <class T>
T seed(double value, std::size_t direction, std::size_t first) noexcept {
  T t(value);
  if constexpr (is_dual_v<T>) {
    if (direction >= first && direction - first < t.grad.size()) t.grad[direction - first] = typename T::Scalar(1);
  }
  return t;
}

/// Widths of the passes that n directions are split into: the narrowest that holds the rest, else the widest.
template <int... widths>
struct Passes {
  /// `pass.operator()<Dual<w>>(first)` for each; stops when one gives false. Without directions one run on double.
  template <class Pass>
  static bool each(std::size_t n, Pass&& pass) noexcept {
    constexpr int widest = std::max({widths...});
    if (n == 0) return pass.template operator()<double>(std::size_t{0});
    for (std::size_t first = 0; first < n;) {
      const int rest = static_cast<int>(std::min<std::size_t>(n - first, widest));
      int chosen = widest;
      ((chosen = widths >= rest ? std::min(chosen, widths) : chosen), ...);
      bool ok = true;
      ((widths == chosen ? void(ok = pass.template operator()<Dual<widths>>(first)) : void()), ...);
      if (!ok) return false;
      first += static_cast<std::size_t>(chosen);
    }
    return true;
  }
};
using DefaultPasses = Passes<4, 8, 12, 16>;

/// One pass: runs the seeded model and hands `visit(k, output, derivatives)` every sample from `skip` on, `derivatives`
/// being the lanes of the pass (none on a plain scalar). False when visit said so or a number left the finite ones.
template <DiscreteModel M, class Inputs, class Visit>
bool sweep(const M& model, typename M::State& state, std::size_t n, std::size_t skip, std::size_t lanes, Inputs&& input,
           Visit&& visit) noexcept {
  using T = typename M::Scalar;
  return run(model, state, n, input, [&](std::size_t k, const T& y) {
    if (k < skip) return true;
    if (!std::isfinite(value_of(y))) return false;
    if constexpr (is_dual_v<T>) {
      for (std::size_t i = 0; i < std::min(lanes, y.grad.size()); ++i)
        if (!std::isfinite(y.grad[i])) return false;
    }
    return visit(k, y);
  });
}

}  // namespace mgdd::dynamics
