// The best input of every point of a map, and the candidates that its worth is reckoned with.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"
#include "mgdd/optimize/limits/multipliers.hpp"

namespace mgdd::optimize {
namespace {

constexpr int map_rounds = 6;
constexpr double map_width = 0.1, map_shrinks = 0.5;  // ranges, per round
constexpr double least_sd = 1e-12;                    // scales of a limit
constexpr double likely_quantile = 1.0;               // of what is asked where nothing is safe
constexpr double reach_beyond_read = 2.0;             // reaches
// Likely to fail by 3 to 1: cells that were never read are not given up for a failure beside them.
constexpr FailingProcess::Demand sure_to_fail{0.0, 0.5, 0.0};
constexpr std::uint64_t draws_per_reading = 1'000'003;

}  // namespace

double MapSeeking::uniform(std::uint64_t stream, int index) const noexcept {
  const auto place = static_cast<std::uint64_t>(told_) * draws_per_reading + static_cast<std::uint64_t>(index);
  return random::uniform(settings_.seed, stream, place);
}
double MapSeeking::normal(std::uint64_t stream, int index) const noexcept {
  const auto place = static_cast<std::uint64_t>(told_) * draws_per_reading + static_cast<std::uint64_t>(index);
  return random::normal(settings_.seed, stream, place);
}

void MapSeeking::put(int row, const Inputs& context, const Inputs& z) noexcept {
  candidates_.row(row).head(context_) = context.transpose();
  candidates_.row(row).tail(inputs_) = settable(z).transpose();
}

// The largest excess of any limit, in its scale, of every candidate: for the map, for what is asked, and where nothing
// is safe; and the largest mean of one in standard deviations.
void MapSeeking::judge(int points) noexcept {
  for (std::vector<double>* one : {&over_, &cautious_, &mean_over_, &odds_})
    std::fill_n(one->begin(), points, -largest_reading);
  for (LimitProcess& limited : limited_) {
    limited.model().predict(candidates_, points);
    for (int p = 0; p < points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const double mean = limited.excess(p, 0.0), sd = limited.sd(p);
      over_[at] = std::max(over_[at], mean + quantile_ * sd);
      cautious_[at] = std::max(cautious_[at], mean + cautious_quantile_ * sd);
      mean_over_[at] = std::max(mean_over_[at], mean + likely_quantile * sd / limited.widening());
      odds_[at] = std::max(odds_[at], mean / std::max(sd, least_sd));
    }
  }
  if (!failing_.by_input()) return;
  failing_.judge(candidates_, points, sure_to_fail, [this](double likely, double mean, int p) {
    const auto at = static_cast<std::size_t>(p);
    over_[at] = std::max(over_[at], likely);
    cautious_[at] = std::max(cautious_[at], likely);
    mean_over_[at] = std::max(mean_over_[at], mean);
    odds_[at] = std::max(odds_[at], mean);
  });
}

// What the bends of the map at a place cost with that input there, the others as they are known.
double MapSeeking::roughness(const Place& place, const Inputs& z) const noexcept {
  double out = 0.0;
  for (const Bend& bend : bends_[static_cast<std::size_t>(&place - places_.data())]) {
    const auto other = [&](std::size_t k) { return bend.weights[k] * places_[bend.others[k]].best; };
    out += settings_.smoothness * (bend.own * z + other(0) + other(1)).squaredNorm();
  }
  return out;
}

void MapSeeking::know_roughness(const Place& place, int from, int count, bool counts) noexcept {
  if (settings_.smoothness == 0.0) return;
  for (int p = from; p < from + count; ++p) {
    const Inputs z = candidates_.row(p).tail(inputs_).transpose();
    rough_[static_cast<std::size_t>(p)] = counts ? roughness(place, z) : 0.0;
  }
}

// Of a place's points the one that is worth most and keeps the limits, or the least unsafe one.
void MapSeeking::keep_best(Place& place, int from, int count, bool smooth) noexcept {
  know_roughness(place, from, count, smooth);
  int best = from;
  for (int p = from + 1; p < from + count; ++p) {
    const auto own = static_cast<std::size_t>(p), known = static_cast<std::size_t>(best);
    const bool safe = over_[own] <= 0.0, was = over_[known] <= 0.0;
    const bool better = safe != was ? safe : safe ? worth(p) > worth(best) : over_[own] < over_[known];
    if (better) best = p;
  }
  place.best = candidates_.row(best).tail(inputs_).transpose();
}

// Of every place its best input, some from everywhere, and a cloud around the best at distances of all sizes; `sure`:
// with the covariances of J.
void MapSeeking::scatter(std::span<const Place> places, bool sure) noexcept {
  int row = 0;
  for (const Place& place : places) {
    put(row++, place.context, place.best);
    for (int p = 0; p < spread; ++p, ++row) {
      Inputs z(inputs_);
      for (Eigen::Index i = 0; i < inputs_; ++i)
        z[i] = uniform(400 + static_cast<std::uint64_t>(i), row);
      z[0] = (p + z[0]) / spread;
      put(row, place.context, z);
    }
    for (int p = 0; p < near; ++p, ++row) {
      const double distance = cloud_nearest * std::pow(cloud_farthest / cloud_nearest, (p + 0.5) / near);
      Inputs z = place.best;
      for (Eigen::Index i = 0; i < inputs_; ++i)
        z[i] += distance * normal(410 + static_cast<std::uint64_t>(i), row);
      put(row, place.context, z);
    }
  }
  judge(row);
  if (sure) {
    j_.predict(candidates_, row);
  } else {
    j_.predict_means(candidates_, row);
  }
}

// Around the best of every place, ever nearer.
void MapSeeking::narrow(std::span<Place> places, bool smooth) noexcept {
  double width = map_width;
  for (int round = 0; round < map_rounds; ++round, width *= map_shrinks) {
    int row = 0;
    for (const Place& place : places) {
      put(row++, place.context, place.best);
      for (int p = 1; p < cloud; ++p, ++row) {
        Inputs z = place.best;
        const auto stream = 420 + static_cast<std::uint64_t>(max_inputs) * static_cast<std::uint64_t>(round);
        for (Eigen::Index i = 0; i < inputs_; ++i)
          z[i] += width * normal(stream + static_cast<std::uint64_t>(i), row);
        put(row, place.context, z);
      }
    }
    judge(row);
    j_.predict_means(candidates_, row);
    int from = 0;
    for (Place& place : places) {
      keep_best(place, from, cloud, smooth);
      from += cloud;
    }
  }
}

// Of every place for itself, then, where it counts, as one smooth map: place by place that is worth ever more.
void MapSeeking::search(std::span<Place> places) noexcept {
  for (Place& place : places)
    place.best = place.from;
  scatter(places, false);
  int from = 0;
  for (Place& place : places) {
    keep_best(place, from, per_place, false);
    from += per_place;
  }
  narrow(places, false);
  if (settings_.smoothness > 0.0) narrow(places, true);
  know_edges(places);
  scatter(places, true);
  from = 0;
  for (const Place& place : places) {
    know_roughness(place, from, per_place, true);
    from += per_place;
  }
  choose_safe(places);
}

// What J of a place would gain by each limit that holds its best input back, were it wider by its scale.
void MapSeeking::know_edges(std::span<const Place> places) noexcept {
  if (limited_.empty()) return;
  const int n = static_cast<int>(inputs_), own = 1 + 2 * n;
  static_assert(1 + 2 * max_inputs <= per_place);
  int row = 0;
  for (const Place& place : places) {
    put(row++, place.context, place.best);
    for (int k = 0; k < n; ++k) {
      for (const double side : {slope_step, -slope_step}) {
        candidates_.row(row) = candidates_.row(row - 1 - (side > 0.0 ? 2 * k : 2 * k + 1));
        candidates_(row, context_ + k) = std::clamp(place.best[k] + side, 0.0, 1.0);
        ++row;
      }
    }
  }
  judge(row);
  j_.predict_means(candidates_, row);
  row = 0;
  for (std::size_t c = 0; c < places.size(); ++c, row += own) {
    Inputs rise(inputs_);
    const auto slope = [&](const ProcessModel& model, int k) {
      const int up = row + 1 + 2 * k;
      return (model.mean(up) - model.mean(up + 1)) /
             (candidates_(up, context_ + k) - candidates_(up + 1, context_ + k));
    };
    for (int k = 0; k < n; ++k) {
      rise[k] = slope(j_, k);
      for (std::size_t i = 0; i < limited_.size(); ++i)
        edges_(static_cast<Eigen::Index>(i), k) = slope(limited_[i].model(), k) / settings_.limits[i].scale;
    }
    multipliers(
        rise, places[c].best, edges_, [&](std::size_t i) { return limited_[i].excess(row, quantile_) > -active_room; },
        std::span(multipliers_).subspan(c * limited_.size(), limited_.size()));
  }
}

// Of a place without an input that is known to be safe, the one that is worth most of those that are as likely to keep
// the limits as any, to `limit_probability`: towards the likeliest one that says little more.
void MapSeeking::know_likeliest(Place& place, int from) noexcept {
  const auto likely = [this](int p) {
    return 0.5 * std::erfc(odds_[static_cast<std::size_t>(p)] / std::numbers::sqrt2);
  };
  double likeliest = 0.0, most = -std::numeric_limits<double>::infinity();
  for (int p = from; p < from + per_place; ++p)
    likeliest = std::max(likeliest, likely(p));
  if (!(likeliest > 0.0)) return;
  for (int p = from; p < from + per_place; ++p) {
    if (likely(p) < settings_.limit_probability * likeliest || worth(p) <= most) continue;
    most = worth(p);
    place.known = p;
  }
}

// The candidates of every place that keep its limits, the best one among them in any case. Where none does, less doubt
// about its limits is worth what J ranges over.
void MapSeeking::choose_safe(std::span<Place> places) noexcept {
  int count = 0;
  for (std::size_t c = 0; c < places.size(); ++c) {
    safe_from_[c] = count;
    const int from = static_cast<int>(c) * per_place;
    double low = j_.mean(from), high = low;
    for (int p = from; p < from + per_place; ++p) {
      low = std::min(low, j_.mean(p));
      high = std::max(high, j_.mean(p));
      if (p == from || over_[static_cast<std::size_t>(p)] <= 0.0) safe_[static_cast<std::size_t>(count++)] = p;
    }
    places[c].known = from;
    if (over_[static_cast<std::size_t>(from)] <= 0.0) continue;
    know_likeliest(places[c], from);
    for (std::size_t i = 0; i < limited_.size(); ++i)
      multipliers_[c * limited_.size() + i] = high - low;
  }
  safe_from_[places.size()] = count;
}

// Whether a candidate may be asked; with limits not far from what was read, and near the best of its place or on the
// way to it.
bool MapSeeking::safe(int point, const Place& place) const noexcept {
  if (cautious_[static_cast<std::size_t>(point)] > 0.0) return false;
  if (limited_.empty()) return true;
  const double beyond = reach_beyond_read * settings_.reach;
  const Inputs low = lowest_.array() - beyond, high = highest_.array() + beyond;
  const Inputs z = candidates_.row(point).tail(inputs_).transpose();
  const Inputs towards = place.best.cwiseMax(low).cwiseMin(high);
  return (z - low).minCoeff() >= 0.0 && (high - z).minCoeff() >= 0.0 &&
         (z - towards).cwiseAbs().maxCoeff() <= settings_.reach;
}

// Where nothing is safe: not far from what was read, the one that most likely keeps its limits.
int MapSeeking::least_unsafe(std::span<const Place> places) const noexcept {
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int p = 0; p < static_cast<int>(places.size()) * per_place; ++p) {
    const Inputs z = candidates_.row(p).tail(inputs_).transpose();
    const double beyond = std::max((lowest_ - z).maxCoeff(), (z - highest_).maxCoeff());
    const double own = mean_over_[static_cast<std::size_t>(p)];
    if (places.size() == cells() && failures_[static_cast<std::size_t>(p / per_place)] >= given_up) continue;
    if (beyond > reach_beyond_read * settings_.reach || own >= least) continue;
    least = own;
    best = p;
  }
  return best;
}

}  // namespace mgdd::optimize
