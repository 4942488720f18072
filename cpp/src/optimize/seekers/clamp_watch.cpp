#include "mgdd/optimize/seekers/clamp_watch.hpp"

namespace mgdd::optimize {
namespace {

constexpr double arriving_share = 0.7;  // of the asked spread: with less, the input is clamped

}  // namespace

ClampWatch::ClampWatch(Eigen::Index inputs) noexcept : lost_(Inputs::Zero(inputs)) {
  forget();
}

void ClampWatch::begin_window() noexcept {
  const Eigen::Index n = lost_.size();
  asked_low_ = applied_low_ = Inputs::Constant(n, largest_reading);
  asked_high_ = applied_high_ = Inputs::Constant(n, -largest_reading);
  lost_.setZero();
  differs_ = false;
}

void ClampWatch::watch(const Inputs& asked, const Inputs& applied, const Inputs& centre) noexcept {
  watching_ = true;
  differs_ = differs_ || applied != asked;
  asked_low_ = asked_low_.cwiseMin(asked);
  asked_high_ = asked_high_.cwiseMax(asked);
  applied_low_ = applied_low_.cwiseMin(applied);
  applied_high_ = applied_high_.cwiseMax(applied);
  ceiling_ = (applied.array() > ceiling_.array()).select(Inputs::Constant(asked.size(), largest_reading), ceiling_);
  floor_ = (applied.array() < floor_.array()).select(Inputs::Constant(asked.size(), -largest_reading), floor_);
  lost_ += (applied - asked).cwiseProduct(asked - centre);
}

void ClampWatch::close_window() noexcept {
  if (!watching_) return;
  const bool differed = differs_;
  clamped_ = false;
  for (Eigen::Index i = 0; differed && i < lost_.size(); ++i) {
    const double asked = asked_high_[i] - asked_low_[i];
    if (!(applied_high_[i] - applied_low_[i] < arriving_share * asked)) continue;
    clamped_ = true;
    if (asked_high_[i] - applied_high_[i] >= applied_low_[i] - asked_low_[i]) {
      ceiling_[i] = applied_high_[i];
    } else {
      floor_[i] = applied_low_[i];
    }
  }
  begin_window();
  watching_ = differed || (ceiling_.array() < largest_reading).any() || (floor_.array() > -largest_reading).any();
}

void ClampWatch::forget() noexcept {
  begin_window();
  watching_ = clamped_ = false;
  ceiling_ = Inputs::Constant(lost_.size(), largest_reading);
  floor_ = -ceiling_;
}

}  // namespace mgdd::optimize
