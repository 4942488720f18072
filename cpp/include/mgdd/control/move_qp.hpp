// Quadratic programme of a few moves inside a box: the Gauss-Newton step of a predictive controller.
// Minimises d'Hd/2 + g'd over low <= d <= high by an active set that starts empty. noexcept, heap-free.
// Source: Nocedal and Wright 2006, chapter 16 (active-set methods).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace mgdd::control {

template <class T, int n_moves>
struct MoveQp {
  static constexpr std::size_t n = static_cast<std::size_t>(n_moves);
  using Column = std::array<T, n>;

  std::array<Column, n> hessian{};
  Column gradient{};

  /// Adds weight (residual + slope'd)²/2.
  void add(T weight, T residual, const Column& slope) noexcept {
    for (std::size_t i = 0; i < n; ++i) {
      const T weighted = weight * slope[i];
      gradient[i] += weighted * residual;
      for (std::size_t j = 0; j <= i; ++j)
        hessian[i][j] += weighted * slope[j];
    }
  }
  /// Adds weight/2 times the squared changes from one move to the next, the first one from `before`.
  void add_changes(T weight, const Column& moves, T before) noexcept {
    T last = before;
    for (std::size_t i = 0; i < n; ++i) {
      const T change = weight * (moves[i] - last);
      last = moves[i];
      gradient[i] += change;
      hessian[i][i] += weight;
      if (i > 0) {
        gradient[i - 1] -= change;
        hessian[i - 1][i - 1] += weight;
        hessian[i][i - 1] -= weight;
      }
    }
  }

  /// The step, its diagonal times `scale` plus `shift`; low <= high.
  Column solve(const Column& low, const Column& high, T scale, T shift) noexcept {
    for (std::size_t i = 0; i < n; ++i)
      hessian[i][i] = hessian[i][i] * scale + shift;
    Column d{};
    std::array<int, n> bound{};  // -1 at low, 1 at high
    for (int pass = 0; pass < 2 * n_moves + 2; ++pass) {
      d = free_step(low, high, bound);
      bool changed = false;
      for (std::size_t i = 0; i < n; ++i) {
        if (bound[i] != 0) continue;
        bound[i] = d[i] < low[i] ? -1 : d[i] > high[i] ? 1 : 0;
        changed = changed || bound[i] != 0;
      }
      if (changed) continue;
      for (std::size_t i = 0; i < n; ++i) {  // a bound that pulls is let go
        if (bound[i] == 0) continue;
        T slope = gradient[i];
        for (std::size_t j = 0; j < n; ++j)
          slope += (j <= i ? hessian[i][j] : hessian[j][i]) * d[j];
        if (slope * T(bound[i]) > T(0.0)) bound[i] = 0, changed = true;
      }
      if (!changed) break;
    }
    for (std::size_t i = 0; i < n; ++i)
      d[i] = std::clamp(d[i], low[i], high[i]);
    return d;
  }

 private:
  // The minimum with the bounded ones at their bounds: LDL' of the free rows.
  Column free_step(const Column& low, const Column& high, const std::array<int, n>& bound) const noexcept {
    Column d{}, right{};
    std::array<Column, n> l{};
    Column pivot{};
    for (std::size_t i = 0; i < n; ++i)
      d[i] = bound[i] < 0 ? low[i] : bound[i] > 0 ? high[i] : T(0.0);
    for (std::size_t i = 0; i < n; ++i) {
      if (bound[i] != 0) continue;
      T r = -gradient[i];
      for (std::size_t j = 0; j < n; ++j) {
        if (bound[j] != 0) r -= (j <= i ? hessian[i][j] : hessian[j][i]) * d[j];
      }
      T p = hessian[i][i];
      for (std::size_t j = 0; j < i; ++j) {
        if (bound[j] != 0) continue;
        T v = hessian[i][j];
        for (std::size_t k = 0; k < j; ++k) {
          if (bound[k] == 0) v -= l[i][k] * l[j][k] * pivot[k];
        }
        l[i][j] = v / pivot[j];
        p -= l[i][j] * l[i][j] * pivot[j];
        r -= l[i][j] * right[j];
      }
      pivot[i] = p;
      right[i] = r;
    }
    for (std::size_t i = n; i-- > 0;) {
      if (bound[i] != 0) continue;
      T v = right[i] / pivot[i];
      for (std::size_t k = i + 1; k < n; ++k) {
        if (bound[k] == 0) v -= l[k][i] * d[k];
      }
      d[i] = v;
    }
    return d;
  }
};

}  // namespace mgdd::control
