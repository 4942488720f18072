// A sensor that shows its input after a whole number of cycles and through a first-order lag.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace mgdd::test_support {

class LaggedSensor {
 public:
  /// `delay` cycles, time constant `lag` cycles (0: none), settled on `at`.
  LaggedSensor(int delay, double lag, double at)
      : line_(static_cast<std::size_t>(delay), at), share_(lag > 0.0 ? 1.0 - std::exp(-1.0 / lag) : 1.0), shown_(at) {}

  double show(double value) {
    if (!line_.empty()) {
      std::swap(value, line_[next_]);
      next_ = (next_ + 1) % line_.size();
    }
    return shown_ += share_ * (value - shown_);
  }

 private:
  std::vector<double> line_;
  double share_, shown_;
  std::size_t next_ = 0;
};

}  // namespace mgdd::test_support
