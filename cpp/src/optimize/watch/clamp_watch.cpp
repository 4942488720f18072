#include "mgdd/optimize/watch/clamp_watch.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr double arriving_share = 0.7;  // of the asked spread: less is too little, and more than its inverse too much
constexpr double other_side = 0.25;     // of what is missed on one side: a lag misses as much on the other
constexpr double standing = 0.1;        // of the asked spread: a plant that goes on by more is on its way
constexpr double wider = 1.5, narrower = 0.9, widest = 8.0;  // quick where nothing is learnt, slow where too much is
constexpr double helping = 1.1;          // by which more arrives of a wider dither, unless the plant's speed is bounded
constexpr double least_response = 0.05;  // share of the dither that must arrive for a slope
constexpr std::int64_t longest_way = 40;  // cycles; a plant that takes longer creeps
constexpr std::int64_t most_vain = 60;    // cycles
constexpr double moving_share = 0.05;     // of the asked distance, in a cycle
constexpr double least_arrived = 0.5;     // of the asked distance: less is waited for, and a slope over less fades

}  // namespace

ClampWatch::ClampWatch(Eigen::Index inputs) noexcept : lost_(Inputs::Zero(inputs)), sent_(lost_), last_(lost_) {
  forget();
}

void ClampWatch::begin_window() noexcept {
  const Eigen::Index n = lost_.size();
  asked_low_ = applied_low_ = Inputs::Constant(n, largest_reading);
  asked_high_ = applied_high_ = Inputs::Constant(n, -largest_reading);
  lost_.setZero();
  differs_ = false;
}

const Inputs& ClampWatch::stretched(const Inputs& wanted, const Inputs& centre, const SearchSpace& space) noexcept {
  stretching_ = (stretch_.array() > 1.0).any();
  if (!stretching_) return wanted;  // NOLINT(bugprone-return-const-ref-from-parameter)
  sent_ = (centre + stretch_.cwiseProduct(wanted - centre)).cwiseMax(space.lower).cwiseMin(space.upper);
  return sent_;
}

bool ClampWatch::on_the_spot(const Inputs& wanted, const Inputs& applied, const Inputs& centre) noexcept {
  bool there = waited_ >= longest_way || in_vain_ > 0;
  if (!there) {
    there = true;
    for (Eigen::Index i = 0; i < wanted.size(); ++i) {
      const double away = wanted[i] - centre[i], to = std::copysign(1.0, away);
      const bool moving = to * (applied[i] - last_[i]) > moving_share * std::abs(away);
      if (moving && to * (applied[i] - centre[i]) < least_arrived * std::abs(away)) there = false;
    }
  }
  last_ = applied;
  if (in_vain_ > 0) --in_vain_;
  if (there && waited_ > 0) {  // a plant that stops is not waited for every time
    vain_ = waited_ > 1 ? 0 : std::min(2 * vain_ + 4, most_vain);
    in_vain_ = vain_;
  }
  waited_ = there ? 0 : waited_ + 1;
  return there;
}

void ClampWatch::watch(const Inputs& wanted, const Inputs& applied, const Inputs& centre) noexcept {
  watching_ = true;
  differs_ = differs_ || applied != wanted;
  asked_low_ = asked_low_.cwiseMin(wanted);
  asked_high_ = asked_high_.cwiseMax(wanted);
  applied_low_ = applied_low_.cwiseMin(applied);
  applied_high_ = applied_high_.cwiseMax(applied);
  ceiling_ = (applied.array() > ceiling_.array()).select(Inputs::Constant(wanted.size(), largest_reading), ceiling_);
  floor_ = (applied.array() < floor_.array()).select(Inputs::Constant(wanted.size(), -largest_reading), floor_);
  lost_ += (applied - wanted).cwiseProduct(wanted - centre);
}

// Of a window: a clamp is missed on one side alone, and stands where it stood a window ago. What is missed on both
// sides, or on the way to what is asked, is a lag or a step.
void ClampWatch::judge(Eigen::Index i) noexcept {
  const double asked = asked_high_[i] - asked_low_[i], arrived = applied_high_[i] - applied_low_[i];
  if (!(asked > 0.0)) return;
  const double before = arriving_[i];
  arriving_[i] = arrived / asked;
  if (arriving_[i] < arriving_share) {
    const double above = asked_high_[i] - applied_high_[i], below = applied_low_[i] - asked_low_[i];
    const bool rests = std::abs(applied_high_[i] - before_high_[i]) <= standing * asked;
    const bool lies = std::abs(applied_low_[i] - before_low_[i]) <= standing * asked;
    if (below <= other_side * above) {
      if (rests) ceiling_[i] = applied_high_[i];
    } else if (above <= other_side * below) {
      if (lies) floor_[i] = applied_low_[i];
    } else {
      const bool useless = stretch_[i] > 1.0 && arriving_[i] > 0.0 && arriving_[i] < helping * before;
      stretch_[i] = useless ? 1.0 : std::min(wider * stretch_[i], widest);
    }
  } else if (arriving_[i] > 1.0 / arriving_share) {
    stretch_[i] = std::max(narrower * stretch_[i], 1.0);
  }
}

void ClampWatch::close_window(const Inputs& power) noexcept {
  if (!watching_) return;
  const bool differed = differs_;
  if (!differed) arriving_.setOnes();
  for (Eigen::Index i = 0; differed && i < lost_.size(); ++i)
    judge(i);
  if (power.size() > 0) response_ = (lost_.cwiseQuotient(power).array() + 1.0).matrix();
  before_low_ = applied_low_;
  before_high_ = applied_high_;
  begin_window();
  watching_ = differed || (ceiling_.array() < largest_reading).any() || (floor_.array() > -largest_reading).any();
}

Inputs ClampWatch::slope_factor() const noexcept {
  return (response_.array().abs() > least_response).select(response_.cwiseInverse(), Inputs::Zero(response_.size()));
}

Inputs ClampWatch::step_factor() const noexcept {
  Inputs out = Inputs::Ones(response_.size());
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    if (response_[i] < -least_response || response_[i] > 1.0)
      out[i] = std::copysign(std::min(1.0, 1.0 / std::abs(response_[i])), response_[i]);
  }
  return out;
}

void ClampWatch::forget() noexcept {
  begin_window();
  watching_ = false;
  waited_ = vain_ = in_vain_ = 0;
  ceiling_ = Inputs::Constant(lost_.size(), largest_reading);
  floor_ = before_low_ = -ceiling_;
  before_high_ = ceiling_;
  stretch_ = arriving_ = response_ = Inputs::Ones(lost_.size());
}

double slope_between(double rise, double distance, double asked) noexcept {
  const double least = least_arrived * std::abs(asked);
  return std::abs(distance) > least ? rise / distance : rise * distance / (least * least);
}

}  // namespace mgdd::optimize
