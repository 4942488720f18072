#include "mgdd/optimize/belief/local_model.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr double fewest_cycles = 4.0;  // before a slope is believed
constexpr double ridge = 1e-12;        // share of each spread: keeps directions that were never moved at slope zero

}  // namespace

LocalModel::LocalModel(Eigen::Index inputs, double memory) noexcept
    : forgetting_(1.0 - 1.0 / std::max(memory, 2.0)),
      mean_input_(Inputs::Zero(inputs)),
      cross_(mean_input_),
      spread_(InputMatrix::Zero(inputs, inputs)) {}

void LocalModel::record(const Inputs& applied, double value) noexcept {
  weight_ = forgetting_ * weight_ + 1.0;
  const double share = 1.0 / weight_;
  const Inputs away = applied - mean_input_;
  const double off = value - mean_;
  cross_ = (1.0 - share) * (cross_ + share * off * away);
  spread_ = (1.0 - share) * (spread_ + share * away * away.transpose());
  variance_ = (1.0 - share) * (variance_ + share * off * off);
  mean_input_ += share * away;
  mean_ += share * off;
}

void LocalModel::forget() noexcept {
  weight_ = mean_ = variance_ = 0.0;
  mean_input_.setZero();
  cross_.setZero();
  spread_.setZero();
}

Inputs LocalModel::slope() const noexcept {
  const double size = spread_.trace();
  if (!(size > 0.0)) return Inputs::Zero(cross_.size());
  if (cross_.size() == 1) return cross_ / size;
  InputMatrix regular = spread_;
  for (Eigen::Index i = 0; i < cross_.size(); ++i)
    regular(i, i) = spread_(i, i) > 0.0 ? (1.0 + ridge) * spread_(i, i) : 1.0;
  return regular.llt().solve(cross_);
}

double LocalModel::predict(const Inputs& at) const noexcept {
  return mean_ + slope().dot(at - mean_input_);
}

double LocalModel::residual_variance() const noexcept {
  return std::max(0.0, variance_ - slope().dot(cross_));
}

double LocalModel::scatter() const noexcept {
  const double freedom = weight_ - 1.0 - static_cast<double>(cross_.size());
  if (weight_ < fewest_cycles || !(freedom > 0.0)) return 0.0;
  return std::sqrt(residual_variance() * weight_ / freedom);
}

bool LocalModel::slope_known(double errors) const noexcept {
  if (weight_ < fewest_cycles) return false;
  const Inputs s = slope();
  const double residual = residual_variance();
  for (Eigen::Index j = 0; j < s.size(); ++j) {
    const double squared_error = residual / (weight_ * std::max(spread_(j, j), 1e-300));
    if (s[j] != 0.0 && s[j] * s[j] > errors * errors * squared_error) return true;
  }
  return false;
}

}  // namespace mgdd::optimize
