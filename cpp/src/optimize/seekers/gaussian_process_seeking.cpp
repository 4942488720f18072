#include "mgdd/optimize/seekers/gaussian_process_seeking.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr int far_candidates = 8, near_candidates = 48;
constexpr int candidates = 1 + far_candidates + near_candidates;
constexpr double cloud_nearest = 0.011, cloud_farthest = 0.3;  // of the near ones, as a share of the bounds
constexpr int search_rounds = 6, search_points = 12;
constexpr double search_width = 0.08, search_shrinks = 0.45;
constexpr double growth = 1.5;                     // of what has been explored
constexpr double planned_readings[] = {1, 4, 16};  // that the worth of an input is reckoned with
constexpr double surprise_rate = 0.1, most_surprise = 3.0;
constexpr std::int64_t calm_cycles = 10;  // after a doubt
constexpr double doubt_age = 3.0;         // memories: what was known counts a twentieth then
constexpr double lags_held = 2.0;
constexpr double active_room = 0.05;   // scales of a limit
constexpr double limit_memory = 20.0;  // cycles of the planes that tell the delays of limits from one another
constexpr double least_noise = 1e-12;

GaussianProcessSeekingSettings checked(GaussianProcessSeekingSettings s) {
  const Eigen::Index n = s.space.size();
  s.space = resolved(std::move(s.space));
  validate(s.space, Inputs::Zero(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::string name = s.space.inputs.empty() ? "" : " of " + s.space.inputs[static_cast<std::size_t>(i)].name;
    for (const auto& [side, value] : {std::pair{"lower", s.space.lower[i]}, std::pair{"upper", s.space.upper[i]}}) {
      if (!std::isfinite(value)) {
        throw ParameterError(side + name, value, "must be finite: inputs are counted in their ranges");
      }
    }
  }
  if (s.noise_sd) require_positive("noise_sd", *s.noise_sd);
  require_in(Domain{0.0, 1e6}, "horizon", s.horizon);
  require_in(Domain{10.0, 1e9}, "memory_cycles", s.memory_cycles);
  require_in(Domain{10.0, 200.0}, "kept", s.kept);
  require_in(Domain{1e-3, 0.5}, "first_step", s.first_step);
  require_in(Domain{0.5, 0.9999}, "limit_probability", s.limit_probability);
  validate(s.sensor, "");
  validate(s.limits);
  for (Limit& limit : s.limits) {
    if (limit.scale == 0.0) limit.scale = limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
  }
  return s;
}

std::vector<UncertainLag> lags_with_j(const GaussianProcessSeekingSettings& s) {
  std::vector<UncertainLag> out{{s.sensor, 0, limit_memory}};
  const std::vector<UncertainLag> limits = lags_of(s.limits, limit_memory);
  out.insert(out.end(), limits.begin(), limits.end());
  return out;
}

ProcessModel::Settings process_settings(const GaussianProcessSeekingSettings& s, bool bends_down) {
  ProcessModel::Settings out;
  out.inputs = s.space.size();
  out.kept = s.kept;
  out.most_points = candidates;
  out.memory = s.memory_cycles;
  out.bends_down = bends_down;
  if (bends_down) out.noise_sd = s.noise_sd;
  out.seed = s.seed;
  return out;
}

}  // namespace

GaussianProcessSeeking::GaussianProcessSeeking(GaussianProcessSeekingSettings settings)
    : settings_(checked(std::move(settings))),
      quantile_(random::normal_quantile(settings_.limit_probability)),
      hold_(1),
      protocol_(settings_.space.size()),
      causes_(lags_with_j(settings_), settings_.space.size()),
      j_(process_settings(settings_, true)),
      limited_(settings_.limits.size(), ProcessModel(process_settings(settings_, false))),
      estimate_(settings_.space.start),
      applied_(estimate_),
      middle_(scaled(estimate_)),
      room_(settings_.limits.size(), 0.0),
      unsafe_(settings_.limits.empty() ? 0 : 1, 0.0),
      candidates_(InputTable::Zero(candidates, settings_.space.size())),
      covariance_(candidates, candidates),
      worth_mean_(candidates, 0.0),
      effect_(candidates, 0.0),
      breaks_(candidates, 0.0),
      over_(candidates, 0.0),
      order_(candidates, 0) {
  double longest = settings_.sensor.lag_cycles;
  for (const Limit& limit : settings_.limits)
    longest = std::max(longest, limit.lag.lag_cycles);
  hold_ += static_cast<std::int64_t>(std::ceil(lags_held * longest));
}

Inputs GaussianProcessSeeking::scaled(const Inputs& input) const noexcept {
  return (input - settings_.space.lower).cwiseQuotient(settings_.space.upper - settings_.space.lower);
}

Inputs GaussianProcessSeeking::unscaled(const Inputs& z) const noexcept {
  const Inputs out = settings_.space.lower + z.cwiseProduct(settings_.space.upper - settings_.space.lower);
  return out.cwiseMax(settings_.space.lower).cwiseMin(settings_.space.upper);
}

// Within the bounds, what may be explored by now, and what is not known to fail.
Inputs GaussianProcessSeeking::reachable(Inputs z) const noexcept {
  const double far = growth * explored_;
  for (Eigen::Index i = 0; i < z.size(); ++i)
    z[i] = std::clamp(z[i], std::max(0.0, middle_[i] - far), std::min(1.0, middle_[i] + far));
  return scaled(protocol_.failures.keep(unscaled(z)));
}

// Standard normal, another one for each stream and index of this cycle.
double GaussianProcessSeeking::draw(std::uint64_t stream, int index) const noexcept {
  return random::normal(settings_.seed, stream, static_cast<std::uint64_t>(protocol_.cycle * 4096 + index));
}

TellStatus GaussianProcessSeeking::tell(const Reading& reading) noexcept {
  const TellStatus status = protocol_.check(reading, 1, limit_count(), applied_.size());
  protocol_.count(status);
  if (status != TellStatus::accepted && status != TellStatus::misfire) return status;
  if (status == TellStatus::accepted) {
    Inputs told;
    learn(reading, protocol_.applied(reading, applied_, told));
  }
  if (++held_ >= hold_ || star_ < 1) {
    held_ = 0;
    choose();
  }
  return status;
}

void GaussianProcessSeeking::learn(const Reading& reading, const Inputs& applied) noexcept {
  causes_.record(applied);
  explored_ = std::max(explored_, (scaled(applied) - middle_).cwiseAbs().maxCoeff());
  const Inputs about = scaled(estimate_);
  const double value = objective_of(reading, settings_.maximize);
  if (causes_.known(0)) {
    const Inputs z = scaled(causes_.of(0, applied));
    watch_surprise(value, z);
    j_.record(z, value, about);
  }
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    causes_.judge(i + 1, applied, reading.limits[i]);
    if (causes_.known(i + 1)) limited_[i].record(scaled(causes_.of(i + 1, applied)), reading.limits[i], about);
  }
}

// Readings that the process does not explain: what was known before is aged.
void GaussianProcessSeeking::watch_surprise(double value, const Inputs& z) noexcept {
  ++since_doubt_;
  if (j_.count() < 3 * static_cast<int>(z.size()) + 3) return;
  candidates_.row(0) = z.transpose();
  j_.predict(candidates_, 1);
  const double noise = std::max(j_.noise_sd(), least_noise * std::abs(value));
  const double variance = std::max(j_.covariance(0, 0), 0.0) + noise * noise;
  const double off = value - j_.mean(0);
  surprise_ += surprise_rate * (std::min(off * off / std::max(variance, 1e-300), 100.0) - surprise_);
  if (since_doubt_ < calm_cycles || surprise_ < most_surprise) return;
  j_.age(doubt_age * settings_.memory_cycles);
  surprise_ = 1.0;
  since_doubt_ = 0;
  ++doubts_;
}

void GaussianProcessSeeking::choose() noexcept {
  const Eigen::Index n = estimate_.size();
  const bool read = j_.count() >= n + 1 && std::all_of(limited_.begin(), limited_.end(),
                                                       [&](const ProcessModel& m) { return m.count() >= n + 1; });
  if (star_ < n || !read) return choose_first();
  const Inputs about = scaled(estimate_);
  j_.fit(about);
  for (ProcessModel& model : limited_)
    model.fit(about);
  const Inputs best = best_of_mean(about);
  estimate_ = unscaled(best);
  draw_candidates(best);
  judge_safety(candidates);
  j_.predict(candidates_, candidates);
  expected_ = (settings_.maximize ? 1.0 : -1.0) * j_.mean(0);
  expected_sd_ = std::sqrt(std::max(j_.covariance(0, 0), 0.0));
  for (std::size_t i = 0; i < limited_.size(); ++i)
    room_[i] = -excess(i, 0) / settings_.limits[i].scale;
  send(candidates_.row(most_worth(candidates)).transpose());
}

// The start, then one input to the side of it per cycle, towards the middle of the bounds; in turns until all is read.
void GaussianProcessSeeking::choose_first() noexcept {
  const Eigen::Index n = estimate_.size();
  const std::int64_t side = star_ < n ? star_ : protocol_.cycle % (n + 1) - 1;
  star_ = std::min<std::int64_t>(star_ + 1, n);
  Inputs z = middle_;
  const double step = settings_.first_step * (limited_.empty() ? 1.0 : 0.5);
  if (side >= 0) z[side] += z[side] < 0.5 ? step : -step;
  explored_ = std::max(explored_, step);
  send(scaled(protocol_.failures.keep(unscaled(z))));
}

void GaussianProcessSeeking::send(const Inputs& z) noexcept {
  const Inputs before = applied();
  Inputs step = unscaled(z) - before;
  for (std::size_t i = 0; i < settings_.space.inputs.size(); ++i) {
    const double rate = settings_.space.inputs[i].rate;
    double& own = step[static_cast<Eigen::Index>(i)];
    own = std::clamp(own, -rate, rate);
  }
  applied_ = (before + step).cwiseMax(settings_.space.lower).cwiseMin(settings_.space.upper);
}

// What limit i would be exceeded by at a point of the last prediction, with the stated probability at most.
double GaussianProcessSeeking::excess(std::size_t i, int point) noexcept {
  const Limit& limit = settings_.limits[i];
  const ProcessModel& model = limited_[i];
  const double sd = std::sqrt(std::max(model.covariance(point, point), 0.0));
  return model.mean(point) + quantile_ * sd + limit.margin + limit.margin_sd * model.noise_sd() - limit.upper;
}

// Largest excess of any limit, in scales, of every candidate.
void GaussianProcessSeeking::judge_safety(int points) noexcept {
  std::fill(over_.begin(), over_.end(), 0.0);
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    limited_[i].predict(candidates_, points);
    for (int p = 0; p < points; ++p) {
      const double own = excess(i, p) / settings_.limits[i].scale;
      double& worst = over_[static_cast<std::size_t>(p)];
      worst = i == 0 ? own : std::max(worst, own);
    }
  }
}

// The best safe mean around a point, by ever narrower clouds; where nothing is safe, the least excess.
Inputs GaussianProcessSeeking::best_of_mean(const Inputs& from) noexcept {
  const Eigen::Index n = from.size();
  Inputs best = reachable(from);
  double best_mean = 0.0, best_over = 0.0;
  bool first = true;
  double width = search_width;
  for (int round = 0; round < search_rounds; ++round, width *= search_shrinks) {
    candidates_.row(0) = best.transpose();
    for (int p = 1; p <= search_points; ++p) {
      Inputs z = best;
      for (Eigen::Index i = 0; i < n; ++i)
        z[i] += width * draw(200 + static_cast<std::uint64_t>(round), p * max_inputs + static_cast<int>(i));
      candidates_.row(p) = reachable(z).transpose();
    }
    judge_safety(search_points + 1);
    j_.predict_means(candidates_, search_points + 1);
    const auto better = [&](double over, double mean) {
      if (over > 0.0 || best_over > 0.0) return over < best_over;
      return mean > best_mean;
    };
    if (first) {
      best_over = over_[0];
      best_mean = j_.mean(0);
      first = false;
    }
    for (int p = 1; p <= search_points; ++p) {
      if (!better(over_[static_cast<std::size_t>(p)], j_.mean(p))) continue;
      best_over = over_[static_cast<std::size_t>(p)];
      best_mean = j_.mean(p);
      best = candidates_.row(p).transpose();
    }
  }
  return best;
}

// The estimate first, then a few from everywhere, then a cloud around the estimate at distances of all sizes.
void GaussianProcessSeeking::draw_candidates(const Inputs& about) noexcept {
  const Eigen::Index n = about.size();
  candidates_.row(0) = about.transpose();
  for (int p = 1; p < candidates; ++p) {
    Inputs z = about;
    const bool far = p <= far_candidates;
    const auto index = static_cast<std::uint64_t>(protocol_.cycle * 4096 + p);
    const double distance =
        cloud_nearest * std::pow(cloud_farthest / cloud_nearest, random::uniform(settings_.seed, 300, index));
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto stream = static_cast<std::uint64_t>(301 + i);
      if (far) {
        z[i] = random::uniform(settings_.seed, stream, index);
      } else {
        z[i] += distance * random::normal(settings_.seed, stream, index);
      }
    }
    candidates_.row(p) = reachable(z).transpose();
  }
}

// Of the safe candidates the one whose J, and what it teaches, is worth most; the least unsafe where none is safe.
int GaussianProcessSeeking::most_worth(int points) noexcept {
  const auto at = [](int p) { return static_cast<std::size_t>(p); };
  int safe = 0;
  for (int p = 0; p < points; ++p) {  // safe ones to the front of the order, in turn
    if (over_[at(p)] <= 0.0) order_[at(safe++)] = p;
  }
  if (!unsafe_.empty()) unsafe_[0] = safe == 0 ? unsafe_[0] + 1.0 : 0.0;
  if (safe == 0) {
    return static_cast<int>(std::min_element(over_.begin(), over_.begin() + points) - over_.begin());
  }
  const std::vector<int>& kept = order_;
  for (int a = 0; a < safe; ++a) {
    worth_mean_[at(a)] = j_.mean(kept[at(a)]);
    for (int b = 0; b <= a; ++b)
      covariance_(a, b) = covariance_(b, a) = j_.covariance(kept[at(a)], kept[at(b)]);
  }
  const double noise = std::max(j_.noise_sd(), least_noise * std::abs(worth_mean_[0]));
  const std::span<const double> means(worth_mean_.data(), at(safe));
  const std::span<double> effects(effect_.data(), at(safe));
  double most = 0.0;
  int best = -1;
  std::array<int, candidates> scratch{};
  for (int a = 0; a < safe; ++a) {
    double taught = 0.0;
    for (const double readings : planned_readings) {
      const double sd = std::sqrt(std::max(covariance_(a, a), 0.0) + noise * noise / readings);
      for (int b = 0; b < safe; ++b)
        effects[at(b)] = sd > 0.0 ? covariance_(b, a) / sd : 0.0;
      const double gain = knowledge_gradient(means, effects, {scratch.data(), at(safe)}, {breaks_.data(), at(safe)});
      taught = std::max(taught, gain / readings);
    }
    const double worth = means[at(a)] + settings_.horizon * taught;
    if (best >= 0 && !(worth > most)) continue;
    most = worth;
    best = kept[at(a)];
  }
  return best;
}

void GaussianProcessSeeking::reseed(std::uint64_t seed) noexcept {
  settings_.seed = seed;
  j_.reseed(seed);
  for (ProcessModel& model : limited_)
    model.reseed(seed);
}

LimitState GaussianProcessSeeking::limit_state(std::size_t i) const noexcept {
  if (unsafe_[0] >= 10.0 && room_[i] < 0.0) return LimitState::infeasible;
  return expected_sd_ > 0.0 && room_[i] < active_room ? LimitState::active : LimitState::free;
}

void GaussianProcessSeeking::restart() noexcept {
  protocol_.failures.forget();
  causes_.forget();
  j_.forget();
  for (ProcessModel& model : limited_)
    model.forget();
  middle_ = scaled(estimate_);
  explored_ = 0.0;
  star_ = held_ = since_doubt_ = 0;
  surprise_ = 1.0;
  expected_ = expected_sd_ = 0.0;
  std::fill(room_.begin(), room_.end(), 0.0);
  std::fill(unsafe_.begin(), unsafe_.end(), 0.0);
  if (!protocol_.asked) applied_ = estimate_;
}

void GaussianProcessSeeking::shift_estimate(const Inputs& by) noexcept {
  move_within(estimate_, by, settings_.space, Inputs::Zero(by.size()));
  if (!protocol_.asked) move_within(applied_, by, settings_.space, Inputs::Zero(by.size()));
  middle_ = scaled(estimate_);
}

}  // namespace mgdd::optimize
