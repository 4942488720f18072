#include "mgdd/optimize/watch/tell_watch.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr double followed_cycles = 50.0;  // several periods of a usual dither
constexpr double fewest_followed = 20.0;

}  // namespace

void TellWatch::read(std::span<const double> components, std::span<const double> limits,
                     const Inputs& applied) noexcept {
  const bool moved = applied != before_;
  before_ = applied;
  for (std::size_t i = 0; i < last_.size(); ++i) {
    const double value = i < components.size() ? components[i] : limits[i - components.size()];
    if (value != last_[i]) {
      alike_[i] = 1.0;
      if (i >= components.size()) most_alike_[i] = 0.0;
    } else if (moved) {
      most_alike_[i] = std::max(most_alike_[i], ++alike_[i]);
    }
    last_[i] = value;
  }
}

void TellWatch::follow(const Inputs& asked, const Inputs& applied) noexcept {
  if (count_ == 0.0 && asked == applied) return;  // as long as all is applied
  count_ += 1.0 - count_ / followed_cycles;
  const auto learn = [share = 1.0 / count_](const Inputs& value, Inputs& mean, Inputs& variance) {
    const Inputs away = value - mean;
    mean += share * away;
    variance = (1.0 - share) * (variance + share * away.cwiseAbs2());
  };
  learn(asked, mean_asked_, asked_);
  learn(applied, mean_applied_, applied_);
}

Inputs TellWatch::applied_share() const noexcept {
  Inputs out = Inputs::Ones(asked_.size());
  for (Eigen::Index i = 0; i < out.size(); ++i)
    if (count_ >= fewest_followed && asked_[i] > 0.0) out[i] = std::sqrt(applied_[i] / asked_[i]);
  return out;
}

}  // namespace mgdd::optimize
