#include "mgdd/optimize/limits/nearest_step.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr int passes = 2000;       // before limits count as contradictory
constexpr int fewer_passes = 200;  // for every trial relaxation of those
constexpr int halvings = 12;       // of the relaxation: to 1/4096 of the worst excess
constexpr double rest = 1e-11;     // share of the largest move: nothing moves any more
constexpr double broken = 1e-7;    // scales: more than rounding leaves over

}  // namespace

NearestStep::NearestStep(std::size_t limits) : planes_(limits) {}

void NearestStep::begin(const Inputs& wish, const InputMatrix& metric, const Inputs& lowest,
                        const Inputs& highest) noexcept {
  count_ = 0;
  wish_ = wish;
  metric_ = metric;
  lowest_ = lowest;
  highest_ = highest;
}

void NearestStep::add(const Inputs& slope, double room, double scale) noexcept {
  Plane& plane = planes_[count_++];
  plane.slope = slope;
  plane.turned.noalias() = metric_ * slope;
  plane.size = slope.dot(plane.turned);
  plane.room = room;
  plane.scale = scale;
}

// The step is wish - metric * (sum of slopes times multipliers): each multiplier in turn, as often as anything moves.
bool NearestStep::ascend(double relaxation, int most_passes) noexcept {
  const Eigen::Index n = wish_.size();
  step_ = wish_;
  low_multiplier_ = high_multiplier_ = Inputs::Zero(n);
  for (std::size_t p = 0; p < count_; ++p)
    planes_[p].multiplier = 0.0;
  double largest = wish_.cwiseAbs().maxCoeff();
  for (int pass = 0; pass < most_passes; ++pass) {
    double moved = 0.0;
    const auto push = [&](double& multiplier, double over, double size, const auto& turned) {
      const double change = std::max(-multiplier, over / size);
      if (change == 0.0) return;
      multiplier += change;
      step_ -= change * turned;
      moved = std::max(moved, std::abs(change) * turned.cwiseAbs().maxCoeff());
    };
    for (std::size_t p = 0; p < count_; ++p) {
      Plane& plane = planes_[p];
      if (!(plane.size > 0.0)) continue;
      const double over = plane.slope.dot(step_) - plane.room - relaxation * plane.scale;
      push(plane.multiplier, over, plane.size, plane.turned);
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const Inputs column = metric_.col(i);
      if (std::isfinite(highest_[i])) push(high_multiplier_[i], step_[i] - highest_[i], column[i], column);
      if (std::isfinite(lowest_[i])) push(low_multiplier_[i], lowest_[i] - step_[i], column[i], -column);
    }
    largest = std::max(largest, moved);
    if (moved <= rest * largest) break;
  }
  return worst_excess(relaxation) <= broken;
}

// Of the step cut to the box, in scales.
double NearestStep::worst_excess(double relaxation) const noexcept {
  const Inputs step = step_.cwiseMax(lowest_).cwiseMin(highest_);
  double worst = 0.0;
  for (std::size_t p = 0; p < count_; ++p) {
    const Plane& plane = planes_[p];
    if (!(plane.size > 0.0)) continue;
    worst = std::max(worst, (plane.slope.dot(step) - plane.room) / plane.scale - relaxation);
  }
  return worst;
}

double NearestStep::solve(double most) noexcept {
  double relaxation = 0.0;
  if (!ascend(0.0, passes) && most > 0.0) relaxation = least_relaxation(most);
  step_ = step_.cwiseMax(lowest_).cwiseMin(highest_);
  return relaxation;
}

double NearestStep::least_relaxation(double most) noexcept {
  double below = 0.0, above = most;
  for (int k = 0; k < halvings; ++k) {
    const double middle = 0.5 * (below + above);
    (ascend(middle, fewer_passes) ? above : below) = middle;
  }
  ascend(above, fewer_passes);
  return above;
}

}  // namespace mgdd::optimize
