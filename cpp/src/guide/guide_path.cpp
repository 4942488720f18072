#include "mgdd/guide/guide_path.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

using optimize::Inputs;

constexpr double least_room = 0.01;  // share of a move: with less room inside the bounds it is not tested

constexpr double least_following = 1e-9;  // unit of the input: the rest is made at once

FeedForwardSettings checked(FeedForwardSettings s, Eigen::Index inputs) {
  if (s.calibration_rate.size() == 0) s.calibration_rate = Inputs::Ones(inputs);
  optimize::validate_entries("calibration_rate", s.calibration_rate, inputs, 0.0);
  require_in(above(0.0, 1.0), "following_share", s.following_share);
  return s;
}

bool usable(const GuideValue& value, const optimize::SearchSpace& space) noexcept {
  const auto n = space.size();
  if (value.optimum.size() != n || !value.optimum.allFinite()) return false;
  if (value.curvature.size() != 0 && value.curvature.size() != n) return false;
  return (value.optimum.array() >= space.lower.array() && value.optimum.array() <= space.upper.array()).all();
}

// K of the move; 0 where the guide does not say it.
double bend_of(const Inputs& curvature, const Inputs& move) noexcept {
  if (curvature.size() != move.size()) return 0.0;
  const double bend = -(curvature.array() * move.array().square()).sum();
  return bend > 0.0 && std::isfinite(bend) ? bend : 0.0;
}

}  // namespace

double share_within(const Inputs& from, const Inputs& move, const optimize::SearchSpace& space) noexcept {
  double share = 1.0;
  for (Eigen::Index i = 0; i < move.size(); ++i) {
    const double room = move[i] > 0.0 ? space.upper[i] - from[i] : from[i] - space.lower[i];
    if (std::abs(move[i]) > room) share = std::min(share, std::max(0.0, room / std::abs(move[i])));
  }
  return share;
}

double worst_excess(const std::vector<optimize::Limit>& limits, std::span<const double> values) noexcept {
  double worst = limits.empty() ? 0.0 : -optimize::unlimited;
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const double size = std::abs(limits[i].upper);
    const double scale = limits[i].scale > 0.0 ? limits[i].scale : size > 0.0 ? size : 1.0;
    worst = std::max(worst, (values[i] + limits[i].margin - limits[i].upper) / scale);
  }
  return worst;
}

GuidePath::GuidePath(FeedForwardSettings settings, Eigen::Index inputs)
    : settings_(checked(std::move(settings), inputs)),
      trust_(settings_.trust, inputs),
      guide_(Inputs::Zero(inputs)),
      feed_forward_(guide_),
      target_(guide_),
      pending_(guide_),
      move_(guide_) {}

std::int64_t GuidePath::side() const noexcept {
  return settings_.trust.probe_cycles + settings_.trust.probe_settling;
}

// Makes that share of the guide's move and says what it is.
Inputs GuidePath::trusted(double share) noexcept {
  const Inputs made = share * move_;
  feed_forward_ += made;
  move_.setZero();
  stage_ = 0;
  return made;
}

GuidePath::Order GuidePath::take(const GuideValue& value, GuideCause cause, const Inputs& estimate,
                                 const optimize::SearchSpace& space) noexcept {
  const bool opens = cause == GuideCause::new_point;
  if (!usable(value, space)) {
    trust_.refuse();
    if (opens) open();
    return {GuideStatus::refused, opens};
  }
  const bool news = opens || open_;
  open_ = false;
  if (!known_) {
    known_ = true;
    guide_ = target_ = value.optimum;
    move_ = value.optimum - estimate;
    feed_forward_ = estimate;
    trust_.forget();
    const Inputs made = trusted(trust_.value());
    return {GuideStatus::followed, true, cause == GuideCause::calibration ? Inputs{} : made};
  }
  if (!news && cause == GuideCause::calibration) {
    const Inputs change = value.optimum - target_;
    pending_ += change;
    guide_ += change;
    target_ = value.optimum;
    return {GuideStatus::followed};
  }
  target_ = value.optimum;
  if (!news) return {GuideStatus::followed};
  move_ += target_ - guide_;
  guide_ = target_;
  feed_forward_ += pending_;  // what is left of a calibration belongs to the old point
  pending_.setZero();
  trust_.forget();
  bend_ = bend_of(value.curvature, move_);
  const double room = share_within(estimate, move_, space);
  tried_ = move_.squaredNorm() > 0.0 && room >= least_room ? std::min(room, trust_.trial_share(bend_)) : 0.0;
  if (!(tried_ > 0.0)) return {GuideStatus::followed, true, trusted(trust_.value())};
  stage_ = 1;
  sums_.fill(0.0);
  return {GuideStatus::followed, true};
}

Inputs GuidePath::test_input(const Inputs& estimate) const noexcept {
  return at_trial() ? Inputs(estimate + tried_ * move_) : estimate;
}

Inputs GuidePath::tested(double j, double excess, const Inputs& away) noexcept {
  const std::size_t place = at_trial() ? 1 : 0;
  if (stage_ - static_cast<std::int64_t>(place) * side() > settings_.trust.probe_settling) {
    sums_[place] += j;
    sums_[2 + place] += excess;
    sums_[4 + place] += away.dot(move_) / move_.squaredNorm();
  }
  if (++stage_ <= 2 * side()) return {};
  if (sums_[3] > 0.0 && sums_[3] > sums_[2]) return trusted(trust_.condemn());
  const double n = settings_.trust.probe_cycles;
  return trusted(trust_.judge((sums_[1] - sums_[0]) / n, sums_[4] / n, sums_[5] / n, bend_));
}

Inputs GuidePath::follow() noexcept {
  if (testing() || guide_ == target_) return {};
  const Inputs ahead = target_ - guide_;
  move_ = settings_.following_share * ahead;
  const bool arrived = move_.cwiseAbs().maxCoeff() <= least_following;
  if (arrived) move_ = ahead;
  guide_ = arrived ? target_ : Inputs(guide_ + move_);
  return trusted(trust_.value());
}

void GuidePath::advance() noexcept {
  Inputs step = pending_;
  optimize::clip_each(step, settings_.calibration_rate);
  feed_forward_ += step;
  pending_ -= step;
}

}  // namespace mgdd::guide
