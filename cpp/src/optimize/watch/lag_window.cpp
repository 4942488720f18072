#include "mgdd/optimize/watch/lag_window.hpp"

#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr double unknown_quantity = 1e9;  // variance, over that of a reading's noise
constexpr double plant_noise = 1.0;       // the same, of what goes through the sensor

}  // namespace

LagWindow::LagWindow(double lag_cycles, Eigen::Index inputs) noexcept
    : keep_(lag_cycles > 0.0 ? std::exp(-1.0 / lag_cycles) : 0.0), inputs_(Inputs::Zero(inputs)), held_(inputs_) {}

// sensor_k = keep sensor_(k-1) + (1 - keep) (quantity + noise of the plant), read with noise of its own.
void LagWindow::learn(double reading) noexcept {
  const double pass = 1.0 - keep_;
  const double from_quantity = keep_ * covariance_ + pass * quantity_variance_;
  const double variance =
      keep_ * (keep_ * sensor_variance_ + pass * covariance_) + pass * (from_quantity + pass * plant_noise);
  const double gain = 1.0 / (variance + 1.0);
  sensor_ = keep_ * sensor_ + pass * quantity_;
  const double off = reading - sensor_;
  sensor_ += variance * gain * off;
  quantity_ += from_quantity * gain * off;
  sensor_variance_ = variance * gain;
  covariance_ = from_quantity * gain;
  quantity_variance_ -= from_quantity * covariance_;
}

bool LagWindow::take(double& value, Inputs& z, std::int64_t hold) noexcept {
  if (keep_ == 0.0) return true;
  const double reading = value;
  if (sensor_ == unread) {
    sensor_ = reading;
    sensor_variance_ = 1.0;
    covariance_ = 0.0;
    return false;
  }
  const Inputs now = z;
  bool full = false;
  const auto close = [&] {
    value = quantity_;
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
    quantity_ = sensor_;
    quantity_variance_ = unknown_quantity;
    covariance_ = 0.0;
    inputs_.setZero();
    held_ = now;
  }
  learn(reading);
  inputs_ += now;
  if (++count_ >= hold && !full) close();
  return full;
}

void LagWindow::forget() noexcept {
  sensor_ = unread;
  count_ = idle_ = 0;
}

}  // namespace mgdd::optimize
