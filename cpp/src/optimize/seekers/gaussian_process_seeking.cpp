#include "mgdd/optimize/seekers/gaussian_process_seeking.hpp"

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

constexpr int far_candidates = 8, near_candidates = 48;
constexpr int candidates = 1 + far_candidates + near_candidates;
constexpr int most_on_their_way = 8;  // inputs whose readings have not come, that are counted on
constexpr double cloud_nearest = 0.011, cloud_farthest = 0.3;  // of the near ones, as a share of the bounds
constexpr int search_rounds = 6, search_points = 12;
constexpr double search_width = 0.08, search_shrinks = 0.45;
constexpr double growth = 0.4;                          // beyond what has been explored, in widths of that
constexpr double guided_reach = 0.2;                    // beyond it at least where there is a guide, in ranges
constexpr double planned_readings[] = {1, 4, 16};       // that the worth of an input is reckoned with
constexpr double rise_of_normal = 0.39894228040143268;  // E max(Z, 0)
constexpr double surprise_rate = 0.1, most_surprise = 3.0;
constexpr std::int64_t calm_cycles = 10;   // after a doubt
constexpr double doubt_age = 10.0;         // memories
constexpr double cautious_readings = 5.0;  // per input and one: before them the horizon is shorter
constexpr double few_readings = 2.0;       // as Student's quantiles exceed the normal ones
constexpr double least_share = 1e-3;       // of a limit, that a reading counts as at least
constexpr double expected_bend = 3.0;  // of a limited quantity, in its scale: few readings must not promise too much
constexpr double active_room = 0.05;   // scales of a limit
constexpr double plane_memory = 20.0;  // cycles of the planes that tell the delays from one another
constexpr double least_noise = 1e-12;

// None, or one of each; a guide says something of every input, and not the same everywhere.
void require_guides(const std::string& name, const std::vector<Surface>& guides, std::size_t count,
                    const std::string& whose, Eigen::Index inputs) {
  if (!guides.empty() && guides.size() != count) {
    throw about(name, ShapeError(name + " has " + std::to_string(guides.size()) + " entries: must have one per " +
                                 whose + ", " + std::to_string(count)));
  }
  for (const Surface& guide : guides) {
    if (guide.empty()) continue;
    if (guide.axes().size() != static_cast<std::size_t>(inputs)) {
      throw about(name, ShapeError(name + " is over " + std::to_string(guide.axes().size()) +
                                   " inputs: must be over the " + std::to_string(inputs) + " that are sought"));
    }
    const auto [least, most] = std::minmax_element(guide.values().begin(), guide.values().end());
    if (*least == *most) throw ParameterError(name, *least, "must not say the same everywhere: leave it out");
  }
}

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
  require_in(Domain{10.0, most_kept}, "kept", s.kept);
  require_in(Domain{1e-3, 0.5}, "first_step", s.first_step);
  require_in(Domain{0.5, 0.9999}, "limit_probability", s.limit_probability);
  validate(s.sensor, "");
  validate(s.limits);
  for (Limit& limit : s.limits) {
    if (limit.scale == 0.0) limit.scale = limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
  }
  if (s.components.empty())
    s.components.push_back(s.sensor);
  else if (s.sensor != ComponentLag{}) {
    throw ParameterError("delay_cycles", s.sensor.delay_cycles, "must be left out where components say their own");
  }
  validate(s.components);
  require_in(Domain{0.0, 20.0}, "delay_uncertainty", s.delay_uncertainty);
  require_guides("guide", s.guide, s.components.size(), "component of J", n);
  require_guides("limit_guides", s.limit_guides, s.limits.size(), "limit", n);
  return s;
}

// Of the limits. Lags are taken out of the readings instead (`Window`).
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

// Limited quantities spread over powers of ten, as NOx: above 0 their logarithm is learnt, with slope 1 at the limit.
double learnt_of(const Limit& limit, double value) {
  if (!(limit.upper > 0.0)) return value;
  return limit.upper * (1.0 + std::log(std::max(value / limit.upper, least_share)));
}

ProcessModel::Settings process_settings(const GaussianProcessSeekingSettings& s) {
  ProcessModel::Settings out;
  out.inputs = s.space.size();
  out.kept = s.kept;
  out.most_points = candidates + most_on_their_way;
  out.memory = s.memory_cycles;
  out.seed = s.seed;
  out.guide = {{}, s.space.lower, s.space.upper, 1.0};
  return out;
}

std::vector<ProcessModel> component_processes(const GaussianProcessSeekingSettings& s) {
  std::vector<ProcessModel> out;
  for (std::size_t i = 0; i < s.components.size(); ++i) {
    ProcessModel::Settings own = process_settings(s);
    if (s.components.size() == 1) own.noise_sd = s.noise_sd;
    if (!s.guide.empty()) own.guide.surface = s.guide[i];
    own.guide.sign = s.maximize ? 1.0 : -1.0;
    out.emplace_back(own);
  }
  return out;
}

std::vector<ProcessModel> limit_processes(const GaussianProcessSeekingSettings& s) {
  std::vector<ProcessModel> out;
  for (std::size_t i = 0; i < s.limits.size(); ++i) {
    ProcessModel::Settings own = process_settings(s);
    own.bends_down = false;
    own.bend = expected_bend * s.limits[i].scale;
    if (!s.limit_guides.empty() && !s.limit_guides[i].empty()) {
      std::vector<double> values = s.limit_guides[i].values();
      for (double& value : values)
        value = learnt_of(s.limits[i], value);
      own.guide.surface = Surface(s.limit_guides[i].axes(), std::move(values));
    }
    out.emplace_back(own);
  }
  return out;
}

}  // namespace

GaussianProcessSeeking::GaussianProcessSeeking(GaussianProcessSeekingSettings settings)
    : settings_(checked(std::move(settings))),
      quantile_(random::normal_quantile(settings_.limit_probability)),
      hold_(1),
      protocol_(settings_.space.size()),
      causes_(lags_of_limits(settings_), settings_.space.size()),
      finders_(finders_of(settings_)),
      j_(component_processes(settings_)),
      limited_(limit_processes(settings_)),
      estimate_(settings_.space.start),
      applied_(estimate_),
      middle_(scaled(estimate_)),
      lowest_(middle_),
      highest_(middle_),
      surprise_(j_.size(), 1.0),
      room_(settings_.limits.size(), 0.0),
      unsafe_(settings_.limits.empty() ? 0 : 1, 0.0),
      candidates_(InputTable::Zero(candidates + most_on_their_way, settings_.space.size())),
      covariance_(candidates, candidates),
      own_(candidates + most_on_their_way, candidates + most_on_their_way),
      means_(Eigen::VectorXd::Zero(candidates)),
      worth_mean_(candidates, 0.0),
      effect_(candidates + most_on_their_way, 0.0),
      breaks_(candidates, 0.0),
      over_(candidates, 0.0),
      mean_over_(candidates, 0.0),
      order_(candidates, 0) {
  double longest = 0.0;
  const auto add = [&](const ComponentLag& lag) {
    longest = std::max(longest, lag.lag_cycles);
    windows_.push_back({.keep = lag.lag_cycles > 0.0 ? std::exp(-1.0 / lag.lag_cycles) : 0.0,
                        .inputs = Inputs::Zero(settings_.space.size()),
                        .held = Inputs::Zero(settings_.space.size())});
  };
  for (const ComponentLag& component : settings_.components)
    add(component);
  for (const Limit& limit : settings_.limits)
    add(limit.lag);
  hold_ = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(longest)));
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
  const double wide = growth * (highest_ - lowest_).maxCoeff(), far = guided() ? std::max(wide, guided_reach) : wide;
  for (Eigen::Index i = 0; i < z.size(); ++i)
    z[i] = std::clamp(z[i], std::max(0.0, lowest_[i] - far), std::min(1.0, highest_[i] + far));
  return scaled(protocol_.failures.keep(unscaled(z)));
}

// Standard normal, another one for each stream and index of this cycle.
double GaussianProcessSeeking::draw(std::uint64_t stream, int index) const noexcept {
  return random::normal(settings_.seed, stream, static_cast<std::uint64_t>(protocol_.cycle * 4096 + index));
}

TellStatus GaussianProcessSeeking::tell(const Reading& reading) noexcept {
  const TellStatus status = protocol_.check(reading, j_.size(), limit_count(), applied_.size());
  protocol_.count(status);
  if (status != TellStatus::accepted && status != TellStatus::misfire) return status;
  Inputs told;
  const Inputs& applied = protocol_.applied(reading, applied_, told);
  causes_.record(applied);
  for (DelayFinder& finder : finders_)
    finder.record(scaled(applied));
  if (status == TellStatus::accepted) {
    learn(reading, applied);
  } else {
    for (Window& window : windows_)
      window.last = unread;
  }
  if (++held_ >= hold_) {
    held_ = 0;
    choose();
  }
  return status;
}

// One reading per window of `hold` cycles: y_k = keep y_(k-1) + (1 - keep) J of the cycle that it comes from.
bool GaussianProcessSeeking::Window::take(double& value, Inputs& z, std::int64_t hold) noexcept {
  if (keep == 0.0) return true;
  const double before = last;
  last = value;
  if (before == unread) return false;
  const double own = (value - keep * before) / (1.0 - keep);
  const Inputs now = z;
  bool full = false;
  const auto close = [&] {
    value = sum / static_cast<double>(count);
    z = inputs / static_cast<double>(count);
    count = idle = 0;
    full = true;
  };
  ++idle;
  if (count > 0 && now != held) {  // an input that never rests is taken as it comes
    if (2 * count >= hold) {
      close();
    } else if (idle < 2 * hold) {
      count = 0;
    }
  }
  if (count == 0) {
    sum = 0.0;
    inputs.setZero();
    held = now;
  }
  sum += own;
  inputs += now;
  if (++count >= hold && !full) close();
  return full;
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
    watch_surprise(i, value, z);
    j_[i].record(z, value, about);
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
    if (causes_.known(i) && windows_[j_.size() + i].take(value, z, hold_)) {
      limited_[i].record(z, learnt_of(settings_.limits[i], value), about);
    }
  }
  if (read) explore(*read);
}

void GaussianProcessSeeking::explore(const Inputs& z) noexcept {
  lowest_ = lowest_.cwiseMin(z);
  highest_ = highest_.cwiseMax(z);
}

// Readings that the process does not explain: what was known before is aged.
void GaussianProcessSeeking::watch_surprise(std::size_t component, double value, const Inputs& z) noexcept {
  ProcessModel& model = j_[component];
  if (component == 0) ++since_doubt_;
  if (model.count() < 3 * static_cast<int>(z.size()) + 3) return;
  candidates_.row(0) = z.transpose();
  model.predict(candidates_, 1);
  const double noise = std::max(model.noise_sd(), least_noise * std::abs(value));
  const double variance = std::max(model.covariance(0, 0), 0.0) + noise * noise;
  const double off = value - model.mean(0);
  double& surprise = surprise_[component];
  surprise += surprise_rate * (std::min(off * off / std::max(variance, 1e-300), 100.0) - surprise);
  if (since_doubt_ >= calm_cycles && surprise >= most_surprise) doubt();
}

void GaussianProcessSeeking::doubt() noexcept {
  for (ProcessModel& model : j_)
    model.age(doubt_age * settings_.memory_cycles);
  std::fill(surprise_.begin(), surprise_.end(), 1.0);
  since_doubt_ = 0;
  ++doubts_;
}

void GaussianProcessSeeking::choose() noexcept {
  const Eigen::Index n = estimate_.size();
  const auto enough = [](const ProcessModel& m) { return m.count() >= m.fewest(); };
  const bool read = std::all_of(j_.begin(), j_.end(), enough) && std::all_of(limited_.begin(), limited_.end(), enough);
  if (!read || (star_ < n && !guided())) return choose_first();
  const Inputs about = scaled(estimate_);
  for (std::vector<ProcessModel>* models : {&j_, &limited_}) {
    for (ProcessModel& model : *models)
      model.fit(about);
  }
  const Inputs best = best_of_mean(about);
  estimate_ = unscaled(best);
  draw_candidates(best);
  judge_safety(candidates);
  means_.setZero();
  covariance_.setZero();
  double variance = 0.0;
  for (std::size_t i = 0; i < j_.size(); ++i) {
    take_in(i, candidates);
    variance += std::max(j_[i].covariance(0, 0), 0.0);
  }
  expected_ = (settings_.maximize ? 1.0 : -1.0) * means_[0];
  expected_sd_ = std::sqrt(variance);
  for (std::size_t i = 0; i < limited_.size(); ++i)
    room_[i] = -excess(i, 0, quantile_) / settings_.limits[i].scale;
  send(candidates_.row(most_worth(candidates)).transpose());
}

// Adds a component's means and covariances at the candidates, these as they will be once what is on its way is read.
void GaussianProcessSeeking::take_in(std::size_t component, int points) noexcept {
  ProcessModel& model = j_[component];
  std::array<int, most_on_their_way> times{};
  int more = 0;
  const DelayFinder& finder = finders_[component];
  for (std::int64_t back = 0; back < finder.on_their_way(); ++back) {
    const Inputs z = finder.before(back);
    int at = 0;
    while (at < more && candidates_.row(points + at).transpose() != z)
      ++at;
    if (at == most_on_their_way) continue;
    if (at == more) candidates_.row(points + more++) = z.transpose();
    ++times[static_cast<std::size_t>(at)];
  }
  if (windows_[component].keep > 0.0) {
    for (int& own : times)
      own = static_cast<int>((own + hold_ - 1) / hold_);
  }
  const int all = points + more;
  model.predict(candidates_, all);
  for (int a = 0; a < all; ++a) {
    if (a < points) means_[a] += model.mean(a);
    for (int b = 0; b <= a; ++b)
      own_(a, b) = own_(b, a) = model.covariance(a, b);
  }
  const double noise = model.noise_sd();
  for (int k = 0; k < more; ++k) {
    const int at = points + k;
    const double variance = own_(at, at) + noise * noise / times[static_cast<std::size_t>(k)];
    if (!(variance > 0.0)) continue;
    for (int a = 0; a < all; ++a)
      effect_[static_cast<std::size_t>(a)] = own_(a, at) / std::sqrt(variance);
    const Eigen::Map<const Eigen::VectorXd> effect(effect_.data(), all);
    for (int b = 0; b < all; ++b)
      own_.col(b).head(all) -= effect[b] * effect;
  }
  covariance_.topLeftCorner(points, points) += own_.topLeftCorner(points, points);
}

double GaussianProcessSeeking::mean(int point) const noexcept {
  double sum = 0.0;
  for (const ProcessModel& model : j_)
    sum += model.mean(point);
  return sum;
}

double GaussianProcessSeeking::noise_sd() const noexcept {
  double squares = 0.0;
  for (const ProcessModel& model : j_)
    squares += model.noise_sd() * model.noise_sd();
  return std::sqrt(squares);
}

// Whether guides say enough to leave the readings to the side out.
bool GaussianProcessSeeking::guided() const noexcept {
  const auto empty = [](const Surface& s) { return s.empty(); };
  return !settings_.guide.empty() && std::none_of(settings_.guide.begin(), settings_.guide.end(), empty) &&
         settings_.limit_guides.size() == settings_.limits.size() &&
         std::none_of(settings_.limit_guides.begin(), settings_.limit_guides.end(), empty);
}

// The start, then one input to the side of it per cycle, towards the middle of the bounds; in turns until all is read.
void GaussianProcessSeeking::choose_first() noexcept {
  const Eigen::Index n = estimate_.size();
  const std::int64_t side = star_ < n ? star_ : protocol_.cycle % (n + 1) - 1;
  star_ = std::min<std::int64_t>(star_ + 1, n);
  Inputs z = middle_;
  const double step = settings_.first_step * (limited_.empty() ? 1.0 : 0.5);
  if (side >= 0) z[side] += z[side] < 0.5 ? step : -step;
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

// What limit i would be exceeded by at a point of the last prediction, that many standard deviations above the mean.
double GaussianProcessSeeking::excess(std::size_t i, int point, double quantile) const noexcept {
  const Limit& limit = settings_.limits[i];
  const ProcessModel& model = limited_[i];
  const double sd = std::sqrt(std::max(model.covariance(point, point), 0.0));
  const double freedom = std::max(1.0, static_cast<double>(model.count() - estimate_.size()));
  return model.mean(point) + quantile * (1.0 + few_readings / freedom) * sd + limit.margin +
         limit.margin_sd * model.noise_sd() - limit.upper;
}

// Largest excess of any limit, in scales, of every candidate: with the stated probability, and in the mean.
void GaussianProcessSeeking::judge_safety(int points) noexcept {
  std::fill(over_.begin(), over_.end(), 0.0);
  std::fill(mean_over_.begin(), mean_over_.end(), 0.0);
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    limited_[i].predict(candidates_, points);
    for (int p = 0; p < points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const double likely = excess(i, p, quantile_) / settings_.limits[i].scale;
      const double mean = excess(i, p, 0.0) / settings_.limits[i].scale;
      over_[at] = i == 0 ? likely : std::max(over_[at], likely);
      mean_over_[at] = i == 0 ? mean : std::max(mean_over_[at], mean);
    }
  }
}

// The best safe mean around a point, by ever narrower clouds; where nothing is safe, the least mean excess.
Inputs GaussianProcessSeeking::best_of_mean(const Inputs& from) noexcept {
  const Eigen::Index n = from.size();
  Inputs best = reachable(from);
  double best_mean = 0.0, best_excess = 0.0;
  bool first = true, safe = false;
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
    for (ProcessModel& model : j_)
      model.predict_means(candidates_, search_points + 1);
    for (int p = first ? 0 : 1; p <= search_points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const bool own_safe = over_[at] <= 0.0;
      const bool better = own_safe != safe ? own_safe : safe ? mean(p) > best_mean : mean_over_[at] < best_excess;
      if (!first && !better) continue;
      first = false;
      safe = own_safe;
      best_excess = mean_over_[at];
      best_mean = mean(p);
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
    return static_cast<int>(std::min_element(mean_over_.begin(), mean_over_.begin() + points) - mean_over_.begin());
  }
  const std::vector<int>& kept = order_;
  for (int a = 0; a < safe; ++a)
    worth_mean_[at(a)] = means_[kept[at(a)]];
  const double noise = std::max(noise_sd(), least_noise * std::abs(worth_mean_[0]));
  const std::span<const double> means(worth_mean_.data(), at(safe));
  const std::span<double> effects(effect_.data(), at(safe));
  // In units of what may be asked anew; early numbers of the processes promise too much.
  const double read =
      static_cast<double>(j_[0].count()) / (cautious_readings * static_cast<double>(1 + estimate_.size()));
  const double horizon = settings_.horizon * std::min(1.0, read) / static_cast<double>(hold_);
  double most = 0.0;
  int best = -1;
  std::array<int, candidates> scratch{};
  for (int a = 0; a < safe; ++a) {
    double taught = 0.0;
    const auto [least, steepest] = std::ranges::minmax_element(kept.begin(), kept.begin() + safe, {},
                                                               [&](int b) { return covariance_(b, kept[at(a)]); });
    const double range = covariance_(*steepest, kept[at(a)]) - covariance_(*least, kept[at(a)]);
    for (const double readings : planned_readings) {
      const double sd = std::sqrt(std::max(covariance_(kept[at(a)], kept[at(a)]), 0.0) + noise * noise / readings);
      if (!(sd > 0.0)) continue;
      // The largest of lines through one point rises by their range of slopes times E max(Z, 0) at most.
      const double at_most = rise_of_normal * range / (sd * readings);
      if (at_most <= taught || (best >= 0 && means[at(a)] + horizon * at_most <= most)) continue;
      for (int b = 0; b < safe; ++b)
        effects[at(b)] = covariance_(kept[at(b)], kept[at(a)]) / sd;
      const double gain = knowledge_gradient(means, effects, {scratch.data(), at(safe)}, {breaks_.data(), at(safe)});
      taught = std::max(taught, gain / readings);
    }
    const double worth = means[at(a)] + horizon * taught;
    if (best >= 0 && !(worth > most)) continue;
    most = worth;
    best = kept[at(a)];
  }
  return best;
}

void GaussianProcessSeeking::reseed(std::uint64_t seed) noexcept {
  settings_.seed = seed;
  for (ProcessModel& model : j_)
    model.reseed(seed);
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
  for (DelayFinder& finder : finders_)
    finder.forget();
  for (std::vector<ProcessModel>* models : {&j_, &limited_}) {
    for (ProcessModel& model : *models)
      model.forget();
  }
  middle_ = lowest_ = highest_ = scaled(estimate_);
  star_ = held_ = since_doubt_ = 0;
  for (Window& window : windows_) {
    window.last = unread;
    window.count = window.idle = 0;
  }
  std::fill(surprise_.begin(), surprise_.end(), 1.0);
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
