#include "mgdd/optimize/seekers/lag_window.hpp"

#include <cmath>

namespace mgdd::optimize {

LagWindow::LagWindow(double lag_cycles, Eigen::Index inputs) noexcept
    : keep_(lag_cycles > 0.0 ? std::exp(-1.0 / lag_cycles) : 0.0), inputs_(Inputs::Zero(inputs)), held_(inputs_) {}

// One reading per window of `hold` cycles: y_k = keep y_(k-1) + (1 - keep) J of the cycle that it comes from.
bool LagWindow::take(double& value, Inputs& z, std::int64_t hold) noexcept {
  if (keep_ == 0.0) return true;
  const double before = last_;
  last_ = value;
  if (before == unread) return false;
  const double own = (value - keep_ * before) / (1.0 - keep_);
  const Inputs now = z;
  bool full = false;
  const auto close = [&] {
    value = sum_ / static_cast<double>(count_);
    z = inputs_ / static_cast<double>(count_);
    count_ = idle_ = 0;
    full = true;
  };
  ++idle_;
  if (count_ > 0 && now != held_) {  // an input that never rests is taken as it comes
    if (2 * count_ >= hold) {
      close();
    } else if (idle_ < 2 * hold) {
      count_ = 0;
    }
  }
  if (count_ == 0) {
    sum_ = 0.0;
    inputs_.setZero();
    held_ = now;
  }
  sum_ += own;
  inputs_ += now;
  if (++count_ >= hold && !full) close();
  return full;
}

void LagWindow::forget() noexcept {
  last_ = unread;
  count_ = idle_ = 0;
}

}  // namespace mgdd::optimize
