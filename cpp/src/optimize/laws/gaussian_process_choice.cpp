// What a seeker by Gaussian processes asks next.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <vector>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
namespace {

constexpr double growth = 0.4;          // beyond what has been explored, in widths of that
constexpr double guided_reach = 0.2;    // beyond it at least where there is a guide, in ranges
constexpr std::int64_t resting = 40;    // inputs at the estimate, then the search is over
constexpr double turned = -0.7;         // what a first step is multiplied by after a failure
constexpr std::int64_t most_turns = 6;  // for them; then inputs that cannot move are left alone
constexpr double along_edges = 8.0;     // sd of J that reading it along limits is worth; 4 stop at corners
constexpr double along_readings = 2.0;  // of the fewest, until it is worth that: early sd promise too much
constexpr double along_cycles = 50.0;   // without a doubt, then it is worth less and less

}  // namespace

// Within the bounds, and what may be explored by now.
Inputs GaussianProcessSeeking::reachable(Inputs z) const noexcept {
  const double wide = growth * (highest_ - lowest_).maxCoeff();
  double explained = 1.0;  // in full where the guide holds a quarter of the bend
  for (const ProcessModel& model : j_)
    explained = std::min(explained, 4.0 * model.guide_share());
  const double least = !guided() ? 0.0 : limited_.empty() ? guided_reach * explained : side_step();
  const double far = std::max({wide, least, protocol_.steps.any() ? grid().maxCoeff() : 0.0});
  for (Eigen::Index i = 0; i < z.size(); ++i)
    z[i] = std::clamp(z[i], std::max(0.0, lowest_[i] - far), std::min(1.0, highest_[i] + far));
  if (!protocol_.steps.any()) return z;
  return scaled(protocol_.steps.nearest(unscaled(z), [](const Inputs&) { return 0.0; }));
}

Inputs GaussianProcessSeeking::grid() const noexcept {
  return protocol_.steps.size.cwiseQuotient(settings_.space.upper - settings_.space.lower);
}

// Standard normal, another one for each stream and index of this cycle.
double GaussianProcessSeeking::draw(std::uint64_t stream, int index) const noexcept {
  return random::normal(settings_.seed, stream, static_cast<std::uint64_t>(protocol_.cycle * 4096 + index));
}

void GaussianProcessSeeking::choose() noexcept {
  const Eigen::Index n = estimate_.size();
  const auto enough = [](const ProcessModel& m) { return m.count() >= m.fewest(); };
  const bool read = std::ranges::all_of(j_, enough) &&
                    std::ranges::all_of(limited_, [&](const LimitProcess& one) { return enough(one.model()); });
  const bool to_every_side = (highest_ - lowest_).minCoeff() > 0.0 || star_ >= most_turns * (n + 1);
  if (!read || !(guided() || (star_ >= n && to_every_side))) return choose_first();
  const Inputs about = since_failure_ > 0 ? scaled(estimate_) : good_;
  fit(about);
  const Inputs best = best_of_mean(about);
  estimate_ = unscaled(best);
  const double aside = dither();
  candidates_.row(0) = best.transpose();
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto bits = static_cast<std::uint64_t>(protocol_.cycle / hold_ * (2 * i + 1));
    candidates_(1, i) = best[i] + (std::popcount(bits) % 2 == 0 ? aside : -aside);
  }
  candidates_.row(1) = reachable(candidates_.row(1).transpose()).transpose();
  std::int64_t awaited = 0;
  for (const DelayFinder& finder : finders_)
    awaited = std::max(awaited, finder.on_their_way());
  const bool over = rested_ * hold_ >= resting * hold_ + awaited;
  const int points = over ? 2 : candidates;
  if (!over) draw_candidates();
  keep_safe(points);
  means_.setZero();
  covariance_.setZero();
  double variance = 0.0;
  for (std::size_t i = 0; i < j_.size(); ++i) {
    take_in(i, points);
    variance += std::max(j_[i].covariance(0, 0), 0.0);
  }
  double off = 0.0;
  for (ProcessModel& model : j_) {
    const ProcessModel::Correction own = model.over_bends(candidates_.row(0).transpose());
    off += own.mean;
    variance += own.variance;
  }
  expected_ = (settings_.maximize ? 1.0 : -1.0) * (means_[0] + off);
  expected_sd_ = j_[0].widening(estimate_.size()) * std::sqrt(std::max(variance, 0.0));
  for (std::size_t i = 0; i < limited_.size(); ++i)
    room_[i] = -limited_[i].excess(0, quantile_);
  const int next = over ? 0 : most_worth(points);
  const bool rests = over_[0] <= 0.0 && (candidates_.row(next) - candidates_.row(0)).cwiseAbs().maxCoeff() <= aside;
  rested_ = rests ? rested_ + 1 : 0;
  send(candidates_.row(rests && over_[1] <= 0.0 ? 1 : next).transpose());
}

void GaussianProcessSeeking::fit(const Inputs& about) noexcept {
  for (ProcessModel& model : j_)
    model.fit(about);
  for (LimitProcess& limited : limited_)
    limited.model().fit(about);
  failing_.fit(about);
}

// How far to the side of the estimate it pays to ask on and on: what is lost by it equals half of what is lost since
// place wanders, in a balance of what readings tell and what is forgotten. In ranges.
double GaussianProcessSeeking::dither() const noexcept {
  double wander = 0.0, bend = 0.0;
  for (const ProcessModel& model : j_) {
    wander += model.slope_wander();
    bend += model.bend();
  }
  return bend > 0.0 ? std::cbrt(std::sqrt(wander) * noise_sd() / (4.0 * bend * bend)) : 0.0;
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
  if (windows_[component].lagged()) {
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

// Whether guides say enough to leave the readings to the side out.
bool GaussianProcessSeeking::guided() const noexcept {
  const auto empty = [](const Surface& s) { return s.empty(); };
  return !settings_.guide.empty() && std::none_of(settings_.guide.begin(), settings_.guide.end(), empty) &&
         settings_.limit_guides.size() == settings_.limits.size() &&
         std::none_of(settings_.limit_guides.begin(), settings_.limit_guides.end(), empty);
}

// The start, then one input to the side of it per cycle, towards the middle of the bounds; in turns until all is read,
// to the other side and nearer where something has failed; anywhere where all that has been tried fails.
void GaussianProcessSeeking::choose_first() noexcept {
  if (protocol_.failures.lost()) return send(scaled(protocol_.failures.elsewhere()));
  const Eigen::Index n = estimate_.size();
  const std::int64_t turn = ++star_ / (n + 1), side = star_ % (n + 1) - 1;
  Inputs z = middle_;
  const double step = side_step() * (failing_.seen_one() ? std::pow(turned, static_cast<double>(turn)) : 1.0);
  if (side >= 0) {
    const double whole = protocol_.steps.any() ? std::max(std::abs(step), grid()[side]) : std::abs(step);
    z[side] += std::copysign(whole, z[side] < 0.5 ? step : -step);
  }
  send(z);
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

// After the estimate and what is to the side of it a few from everywhere, then a cloud around it, at distances of all
// sizes.
void GaussianProcessSeeking::draw_candidates() noexcept {
  const Inputs about = candidates_.row(0).transpose();
  const Eigen::Index n = about.size();
  for (int p = 2; p < candidates; ++p) {
    Inputs z = about;
    const bool far = p < 2 + far_candidates;
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

// Where limits hold the best input back, of the first `safe` ones in the order: the knowledge gradient among safe
// inputs is blind to what a limit hides. Off what was read it grows less sure, which would cost more J than a reading
// promises: the credit gives that back, so that the search slides along the edges.
int GaussianProcessSeeking::most_along(int safe) const noexcept {
  const double read = static_cast<double>(j_[0].count()) / (along_readings * j_[0].fewest());
  const double settled = static_cast<double>(since_doubt_) / along_cycles;
  const double beta = along_edges * std::min(1.0, read) / std::max(1.0, settled);
  const auto worth = [&](int p) {
    return means_[p] + beta * std::sqrt(std::max(covariance_(p, p), 0.0)) + credit_[static_cast<std::size_t>(p)];
  };
  return *std::max_element(order_.begin(), order_.begin() + safe, [&](int a, int b) { return worth(a) < worth(b); });
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
  if (std::ranges::any_of(multipliers_, [](double own) { return own > 0.0; })) return most_along(safe);
  const double noise = std::max(noise_sd(), worth_noise * std::abs(means_[order_[0]]));
  // In units of what may be asked anew; early numbers of the processes promise too much.
  const double read =
      static_cast<double>(j_[0].count()) / (cautious_readings * static_cast<double>(1 + estimate_.size()));
  const double horizon = settings_.horizon * std::min(1.0, read) / static_cast<double>(hold_);
  return optimize::most_worth(
      {order_.data(), at(safe)}, [this](int p) { return means_[p]; },
      [this](int p, int q) { return covariance_(p, q); }, noise, horizon, worth_);
}

}  // namespace mgdd::optimize
