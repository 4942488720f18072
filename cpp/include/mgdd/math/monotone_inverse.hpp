// Inverse of a function that does not fall: bisection to the last bit, no derivative, no failure. Units are those of
// the function. noexcept as the function is, heap-free; about 60 evaluations.
#pragma once

namespace mgdd {

/// Smallest x in [low, high] with f(x) >= target; `high` where there is none.
template <class F>
double monotone_inverse(const F& f, double target, double low, double high) noexcept(noexcept(f(low))) {
  if (f(low) >= target) return low;
  for (;;) {
    const double middle = 0.5 * (low + high);
    if (!(middle > low && middle < high)) return high;
    (f(middle) >= target ? high : low) = middle;
  }
}

}  // namespace mgdd
