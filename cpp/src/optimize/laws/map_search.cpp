// The best input of every point of a map, and the candidates that its worth is reckoned with.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
namespace {

constexpr double least_sd = 1e-12;         // scales of a limit
constexpr double likely_quantile = 1.0;    // of what is asked where nothing is safe
constexpr double reach_beyond_read = 2.0;  // reaches
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

// The largest excess of any limit, in its scale, of candidates: for the map, for what is asked, and where nothing is
// safe; and the largest mean of one in standard deviations.
void MapSeeking::judge(int points, int from) noexcept {
  for (std::vector<double>* one : {&over_, &cautious_, &mean_over_, &odds_})
    std::fill_n(one->begin() + from, points, -largest_reading);
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    LimitProcess& limited = limited_[i];
    limited.model().predict(candidates_, points, from);
    for (int p = from; p < from + points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const double mean = limited.excess(p, 0.0), sd = limited.sd(p);
      excess_(static_cast<Eigen::Index>(i), p) = mean + quantile_ * sd;
      over_[at] = std::max(over_[at], mean + quantile_ * sd);
      cautious_[at] = std::max(cautious_[at], mean + cautious_quantile_ * sd);
      mean_over_[at] = std::max(mean_over_[at], mean + likely_quantile * sd / limited.widening());
      odds_[at] = std::max(odds_[at], mean / std::max(sd, least_sd));
    }
  }
  if (failing_.by_input()) failing_.predict(candidates_, points, from);
}

// Which of candidates that have been judged are likely to fail.
void MapSeeking::judge_failing(int points, int from) noexcept {
  if (!failing_.by_input()) return;
  failing_.judge(points, from, sure_to_fail, [this](double likely, double mean, int p) {
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

// Some from everywhere, and where the search begins.
void MapSeeking::spread_out(std::span<Place> places) noexcept {
  int row = point_of(0, 1 + near);
  for (const Place& place : places) {
    for (int p = 0; p < spread; ++p, ++row) {
      Inputs z(inputs_);
      for (Eigen::Index i = 0; i < inputs_; ++i)
        z[i] = uniform(400 + static_cast<std::uint64_t>(i), row);
      z[0] = (p + z[0]) / spread;
      put(row, place.context, z);
    }
  }
  for (const Place& place : places)
    put(row++, place.context, place.from);
  const int first = point_of(0, 1 + near), count = row - first;
  judge(count, first);
  judge_failing(count, first);
  j_.predict(candidates_, count, first);
  row = last_point();
  for (std::size_t c = 0; c < places.size(); ++c, ++row) {
    know_roughness(places[c], row, 1, false);
    places[c].best = candidates_.row(row).tail(inputs_).transpose();
    places[c].climb.begin(places[c].best, worth_of(row));
    consider(places[c], point_of(c, 1 + near), spread, false);
  }
}

Climb::Worth MapSeeking::worth_of(int point) const noexcept {
  return {over_[static_cast<std::size_t>(point)], worth(point)};
}

// With the other places as they are by now: what this one gains, a smooth map gains.
void MapSeeking::consider(Place& place, int from, int count, bool smooth) noexcept {
  know_roughness(place, from, count, smooth);
  if (smooth && settings_.smoothness > 0.0) {
    const double rough = roughness(place, place.best);
    place.climb.renew({place.climb.known().over, place.climb.known().worth + place.rough - rough});
    place.rough = rough;
  }
  for (int p = from; p < from + count; ++p) {
    if (!place.climb.consider(candidates_.row(p).tail(inputs_).transpose(), worth_of(p))) continue;
    place.best = place.climb.best();
    place.rough = rough_[static_cast<std::size_t>(p)];
  }
}

// From the best of every place uphill, along its limits.
void MapSeeking::climb(std::span<Place> places, bool smooth) noexcept {
  const int first = last_point();
  const auto limits = static_cast<Eigen::Index>(limited_.size());
  const auto take = [&](int per) {
    const int count = per * searching_;
    judge(count, first);
    judge_failing(count, first);
    j_.predict_means(candidates_, count, first);
  };
  const auto over_at = [&](int p) {
    for (Eigen::Index i = 0; i < limits; ++i)
      edge_over_[static_cast<std::size_t>(i)] = excess_(i, p) + Climb::inside;
    return std::span(edge_over_);
  };
  if (smooth) {
    for (Place& place : places)
      place.climb.begin(place.best, place.climb.known());
  }
  const auto edges_of = [&](std::size_t c) { return edges_.middleRows(static_cast<Eigen::Index>(c) * limits, limits); };
  for (int round = 0; round < Climb::rounds; ++round) {
    const int star = places[0].climb.star();
    for (int p = 0; p < star * searching_; ++p) {
      const Place& place = places[static_cast<std::size_t>(p / star)];
      put(first + p, place.context, place.climb.beside(p % star, aside_));
    }
    take(star);
    for (std::size_t c = 0; c < places.size(); ++c) {
      Climb& own = places[c].climb;
      const int at = first + static_cast<int>(c) * star;
      auto edges = edges_of(c);
      know_roughness(places[c], at, star, smooth);
      for (Eigen::Index i = 0; i < limits; ++i)
        own.slopes(aside_, [&](int k) { return excess_(i, at + k); }, edges.row(i));
      own.renew(worth_of(at));
      places[c].rough = rough_[static_cast<std::size_t>(at)];
      own.aim(aside_, [&](int k) { return worth(at + k); }, edges, over_at(at), nearest_);
      for (std::size_t i = 0; i < limited_.size(); ++i)
        multipliers_[c * limited_.size() + i] = nearest_.multiplier(i);
      if (steps_.any()) consider(places[c], at, star, smooth);
    }
    for (const bool back : {false, true}) {
      int row = first;
      for (std::size_t c = 0; c < places.size(); ++c) {
        const Climb& own = places[c].climb;
        for (int k = 0; k < Climb::tries; ++k, ++row)
          put(row, places[c].context, back ? own.moved_back(k, edges_of(c), over_at(row), nearest_) : own.tried(k));
      }
      take(Climb::tries);
      for (std::size_t c = 0; c < places.size(); ++c)
        consider(places[c], first + static_cast<int>(c) * Climb::tries, Climb::tries, smooth);
      if (limits == 0) break;
    }
    for (Place& place : places)
      place.climb.narrow();
  }
}

// Of every place its best input and a cloud around it at distances of all sizes.
void MapSeeking::cloud_around(std::span<const Place> places) noexcept {
  int row = 0;
  for (const Place& place : places) {
    put(row++, place.context, place.best);
    for (int p = 0; p < near; ++p, ++row) {
      const double distance = cloud_nearest * std::pow(cloud_farthest / cloud_nearest, (p + 0.5) / near);
      Inputs z = place.best;
      for (Eigen::Index i = 0; i < inputs_; ++i)
        z[i] += distance * normal(410 + static_cast<std::uint64_t>(i), row);
      put(row, place.context, z);
    }
  }
  judge(row, 0);
  j_.predict(candidates_, row, 0);
  judge_failing(last_point(), 0);
}

// Of every place for itself, then, where it counts, as one smooth map: place by place that is worth ever more.
void MapSeeking::search(std::span<Place> places) noexcept {
  searching_ = static_cast<int>(places.size());
  spread_out(places);
  climb(places, false);
  if (settings_.smoothness > 0.0) climb(places, true);
  cloud_around(places);
  for (std::size_t c = 0; c < places.size(); ++c) {
    know_roughness(places[c], point_of(c, 0), 1 + near, true);
    know_roughness(places[c], point_of(c, 1 + near), spread, true);
  }
  choose_safe(places);
}

// Of a place without an input that is known to be safe, the one that is worth most of those that are as likely to keep
// the limits as any, to `limit_probability`: towards the likeliest one that says little more. Where even that surely
// breaks one, the one that breaks them least.
void MapSeeking::know_likeliest(std::size_t c, Place& place) noexcept {
  const auto likely = [this](int p) {
    return 0.5 * std::erfc(odds_[static_cast<std::size_t>(p)] / std::numbers::sqrt2);
  };
  double likeliest = 0.0, most = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < per_place; ++k)
    likeliest = std::max(likeliest, likely(point_of(c, k)));
  if (!(likeliest > 1.0 - settings_.limit_probability)) return;
  for (int k = 0; k < per_place; ++k) {
    const int p = point_of(c, k);
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
    const int first = point_of(c, 0);
    double low = j_.mean(first), high = low;
    for (int k = 0; k < per_place; ++k) {
      const int p = point_of(c, k);
      low = std::min(low, j_.mean(p));
      high = std::max(high, j_.mean(p));
      if (k == 0 || over_[static_cast<std::size_t>(p)] <= 0.0) safe_[static_cast<std::size_t>(count++)] = p;
    }
    places[c].known = first;
    if (over_[static_cast<std::size_t>(first)] <= 0.0) continue;
    know_likeliest(c, places[c]);
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

// Whether a candidate is not far from what was read.
bool MapSeeking::within_reach(int point) const noexcept {
  const Inputs z = candidates_.row(point).tail(inputs_).transpose();
  return std::max((lowest_ - z).maxCoeff(), (z - highest_).maxCoeff()) <= reach_beyond_read * settings_.reach;
}

// Where nothing is safe: not far from what was read, the one that most likely keeps its limits.
int MapSeeking::least_unsafe(std::span<const Place> places) const noexcept {
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int p = 0; p < last_point(); ++p) {
    const double own = mean_over_[static_cast<std::size_t>(p)];
    if (places.size() == cells() && failures_[place_of(p)] >= given_up) continue;
    if (!within_reach(p) || own >= least) continue;
    least = own;
    best = p;
  }
  return best;
}

}  // namespace mgdd::optimize
