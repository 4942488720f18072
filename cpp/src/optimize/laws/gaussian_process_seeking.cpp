#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr std::int64_t calm_cycles = 10;  // after a doubt
constexpr std::int64_t most_wary = 64;    // cycles that work, after a failure
constexpr double held_share = 0.7;        // of the longest lag, for which an input is asked
constexpr double plane_memory = 20.0;     // cycles of the planes that tell the delays from one another

// Of the limits. Lags are taken out of the readings instead (`LagWindow`).
std::vector<UncertainLag> lags_of_limits(const GaussianProcessSeekingSettings& s) {
  std::vector<UncertainLag> out = lags_of(s.limits, plane_memory);
  for (UncertainLag& one : out) {
    if (one.lag.lag_cycles > 0.0) one.delay_uncertainty = 0;
    one.lag.lag_cycles = 0.0;
  }
  return out;
}

std::vector<DelayFinder> finders_of(const GaussianProcessSeekingSettings& s) {
  std::vector<DelayFinder> out;
  for (const ComponentLag& lag : s.components) {
    const bool uncertain = lag.delay_cycles > 0.0 && lag.lag_cycles == 0.0;
    out.emplace_back(lag.delay_cycles, uncertain ? s.delay_uncertainty : 0, s.space.size());
  }
  return out;
}

ProcessModel::Settings process_settings(const GaussianProcessSeekingSettings& s, int most_points) {
  ProcessModel::Settings out;
  out.inputs = s.space.size();
  out.kept = s.kept;
  out.most_points = most_points;
  out.memory = s.memory_cycles;
  out.seed = s.seed;
  out.guide = {{}, s.space.lower, s.space.upper, 1.0};
  return out;
}

std::vector<ProcessModel> component_processes(const GaussianProcessSeekingSettings& s, int most_points) {
  std::vector<ProcessModel> out;
  for (std::size_t i = 0; i < s.components.size(); ++i) {
    ProcessModel::Settings own = process_settings(s, most_points);
    if (s.components.size() == 1) own.noise_sd = s.noise_sd;
    if (!s.guide.empty()) own.guide.surface = s.guide[i];
    own.guide.sign = s.maximize ? 1.0 : -1.0;
    out.emplace_back(own);
  }
  return out;
}

std::vector<LimitProcess> limit_processes(const GaussianProcessSeekingSettings& s, int most_points) {
  std::vector<LimitProcess> out;
  for (std::size_t i = 0; i < s.limits.size(); ++i) {
    const Surface guide = s.limit_guides.empty() ? Surface{} : s.limit_guides[i];
    out.emplace_back(s.limits[i], process_settings(s, most_points), guide, s.space.size(), 1.0);
  }
  return out;
}

}  // namespace

GaussianProcessSeeking::GaussianProcessSeeking(GaussianProcessSeekingSettings settings)
    : settings_(resolved(std::move(settings))),
      quantile_(random::normal_quantile(settings_.limit_probability)),
      cautious_quantile_(random::normal_quantile(1.0 - (1.0 - settings_.limit_probability) / cautious_cycles)),
      hold_(1),
      protocol_(settings_.space, settings_.components.size() + settings_.limits.size(),
                false),  // its own process knows what fails
      causes_(lags_of_limits(settings_), settings_.space.size()),
      finders_(finders_of(settings_)),
      j_(component_processes(settings_, candidates + most_on_their_way)),
      limited_(limit_processes(settings_, candidates + most_on_their_way)),
      failing_(process_settings(settings_, candidates)),
      estimate_(settings_.space.start),
      applied_(estimate_),
      middle_(scaled(estimate_)),
      good_(middle_),
      lowest_(middle_),
      highest_(middle_),
      surprise_(j_.size()),
      room_(settings_.limits.size(), 0.0),
      unsafe_(settings_.limits.empty() ? 0 : 1, 0.0),
      candidates_(InputTable::Zero(candidates + most_on_their_way, settings_.space.size())),
      edges_(InputTable::Zero(static_cast<Eigen::Index>(settings_.limits.size()), settings_.space.size())),
      covariance_(candidates, candidates),
      own_(candidates + most_on_their_way, candidates + most_on_their_way),
      means_(Eigen::VectorXd::Zero(candidates)),
      effect_(candidates + most_on_their_way, 0.0),
      over_(candidates, 0.0),
      mean_over_(candidates, 0.0),
      excess_(InputTable::Zero(static_cast<Eigen::Index>(settings_.limits.size()), candidates)),
      edge_over_(room_),
      aside_(Inputs::Constant(settings_.space.size(), slope_step)),
      multipliers_(room_),
      credit_(candidates, 0.0),
      nearest_(settings_.limits.size()),
      order_(candidates, 0),
      worth_(candidates) {
  if (protocol_.steps.any()) aside_ = aside_.cwiseMax(grid());
  double longest = 0.0;
  const auto add = [&](const ComponentLag& lag) {
    longest = std::max(longest, lag.lag_cycles);
    windows_.emplace_back(lag.lag_cycles, settings_.space.size());
  };
  for (const ComponentLag& component : settings_.components)
    add(component);
  for (const Limit& limit : settings_.limits)
    add(limit.lag);
  hold_ = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(held_share * longest)));
}

Inputs GaussianProcessSeeking::scaled(const Inputs& input) const noexcept {
  return (input - settings_.space.lower).cwiseQuotient(settings_.space.upper - settings_.space.lower);
}

Inputs GaussianProcessSeeking::unscaled(const Inputs& z) const noexcept {
  const Inputs out = settings_.space.lower + z.cwiseProduct(settings_.space.upper - settings_.space.lower);
  return out.cwiseMax(settings_.space.lower).cwiseMin(settings_.space.upper);
}

TellStatus GaussianProcessSeeking::tell(const Reading& reading) noexcept {
  const TellStatus status = protocol_.check(reading, j_.size(), limit_count(), applied_.size());
  const bool lost = protocol_.failures.lost();
  protocol_.count(status, reading);
  if (status != TellStatus::accepted && status != TellStatus::misfire) return status;
  Inputs told;
  const Inputs& applied = protocol_.applied(reading, applied_, told);
  causes_.record(applied);
  for (DelayFinder& finder : finders_)
    finder.record(scaled(applied));
  const bool worked = status == TellStatus::accepted;
  since_failure_ = worked ? since_failure_ + 1 : 0;
  if (worked) {
    good_ = scaled(applied);
    if (lost) {  // the search begins at the first input that works
      middle_ = lowest_ = highest_ = good_;
      estimate_ = unscaled(good_);
      star_ = 0;
    }
  } else {
    wary_ = std::min(2 * wary_, most_wary);
  }
  failing_.record(scaled(applied), worked, scaled(estimate_));
  if (worked) {
    learn(reading, applied);
  } else {
    for (LagWindow& window : windows_)
      window.skip();
  }
  if (++held_ >= hold_) {
    held_ = 0;
    choose();
  }
  return status;
}

void GaussianProcessSeeking::learn(const Reading& reading, const Inputs& applied) noexcept {
  const Inputs about = scaled(estimate_);
  // Only what has been read widens what may be asked: the inputs behind the latest of all readings.
  std::optional<Inputs> read;
  std::int64_t latest = -1;
  for (std::size_t i = 0; i < j_.size(); ++i) {
    double value = settings_.maximize ? reading.components[i] : -reading.components[i];
    DelayFinder& finder = finders_[i];
    finder.read(value);
    if (finder.judge(j_[i], about)) continue;
    if (finder.delay() > latest) {
      latest = finder.delay();
      read.reset();
      if (finder.known()) read = finder.cause();
    }
    if (!finder.known()) continue;
    Inputs z = finder.cause();
    if (!windows_[i].take(value, z, hold_)) continue;
    watch_surprise(i, j_[i].record(z, value, about));
    if (j_[i].wakes_up()) begin_anew(i);
  }
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    double value = reading.limits[i];
    causes_.judge(i, applied, value);
    Inputs z = scaled(causes_.of(i, applied));
    if (causes_.delay_cycles(i) > static_cast<double>(latest)) {
      latest = static_cast<std::int64_t>(std::ceil(causes_.delay_cycles(i)));
      read.reset();
      if (causes_.known(i)) read = z;
    }
    if (causes_.known(i) && windows_[j_.size() + i].take(value, z, hold_)) limited_[i].record(z, value, about);
  }
  if (read) explore(*read);
}

// A channel that stood still says no more than where it stood; what it says now has a scale of its own.
void GaussianProcessSeeking::begin_anew(std::size_t component) noexcept {
  j_[component].forget();
  surprise_[component].reset();
  middle_ = scaled(estimate_);
  star_ = rested_ = 0;
}

void GaussianProcessSeeking::explore(const Inputs& z) noexcept {
  lowest_ = lowest_.cwiseMin(z);
  highest_ = highest_.cwiseMax(z);
}

// Two readings in a row that the process does not explain: what was known before is aged.
void GaussianProcessSeeking::watch_surprise(std::size_t component, double odd) noexcept {
  if (component == 0) ++since_doubt_;
  const bool surprising = surprise_[component].add(odd);
  if (since_doubt_ >= calm_cycles && surprising) doubt();
}

void GaussianProcessSeeking::doubt() noexcept {
  for (ProcessModel& model : j_)
    model.age(doubt_age * settings_.memory_cycles);
  for (Surprise& one : surprise_)
    one.reset();
  since_doubt_ = rested_ = 0;
  ++doubts_;
}

double GaussianProcessSeeking::noise_sd() const noexcept {
  double squares = 0.0;
  for (const ProcessModel& model : j_)
    squares += model.noise_sd() * model.noise_sd();
  return std::sqrt(squares);
}

double GaussianProcessSeeking::trust() const noexcept {
  double least = 1.0;
  for (const ProcessModel& model : j_)
    least = std::min(least, model.guide_share());
  return least;
}

void GaussianProcessSeeking::reseed(std::uint64_t seed) noexcept {
  settings_.seed = seed;
  for (ProcessModel& model : j_)
    model.reseed(seed);
  for (LimitProcess& limited : limited_)
    limited.model().reseed(seed);
  failing_.reseed(seed);
}

LimitState GaussianProcessSeeking::limit_state(std::size_t i) const noexcept {
  if (unsafe_[0] >= 10.0 && room_[i] < 0.0) return LimitState::infeasible;
  return expected_sd_ > 0.0 && room_[i] < active_room ? LimitState::active : LimitState::free;
}

void GaussianProcessSeeking::restart() noexcept {
  protocol_.failures.forget();
  causes_.forget();
  for (DelayFinder& finder : finders_)
    finder.forget();
  for (ProcessModel& model : j_)
    model.forget();
  for (LimitProcess& limited : limited_)
    limited.model().forget();
  failing_.forget();
  wary_ = least_wary;
  middle_ = good_ = lowest_ = highest_ = scaled(estimate_);
  star_ = held_ = rested_ = since_doubt_ = since_failure_ = 0;
  for (LagWindow& window : windows_)
    window.forget();
  for (Surprise& one : surprise_)
    one.reset();
  expected_ = expected_sd_ = 0.0;
  std::fill(room_.begin(), room_.end(), 0.0);
  std::fill(unsafe_.begin(), unsafe_.end(), 0.0);
  if (!protocol_.asked) applied_ = estimate_;
}

void GaussianProcessSeeking::shift_estimate(const Inputs& by) noexcept {
  move_within(estimate_, by, settings_.space, Inputs::Zero(by.size()));
  if (!protocol_.asked) move_within(applied_, by, settings_.space, Inputs::Zero(by.size()));
  middle_ = scaled(estimate_);
  explore(middle_);
}

}  // namespace mgdd::optimize
