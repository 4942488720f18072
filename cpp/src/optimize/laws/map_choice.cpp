// Where a map is read next.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
namespace {

constexpr double by_chance = 0.1;   // of the visits fail
constexpr double promising = 2.0;   // standard deviations
constexpr double first_room = 0.1;  // scales of a limit that a guide leaves free at the first visit
constexpr int first_draws = 400;
constexpr double first_step = 0.1;     // ranges
constexpr double least_effect = 1e-9;  // of a standard deviation
constexpr double little = 1e-3;        // of what J was read to range over: nothing more is to be gained

}  // namespace

// The largest J by the guide with room to its limits, or the start.
Inputs MapSeeking::first_input(const Inputs& context) const noexcept {
  Inputs best = scaled(settings_.space.start);
  if (settings_.guide.empty()) return best;
  Inputs at(context_ + inputs_);
  at.head(context_) = context;
  double most = -std::numeric_limits<double>::infinity(), least_over = -most;
  for (int p = 0; p < first_draws; ++p) {
    Inputs z(inputs_);
    for (Eigen::Index i = 0; i < inputs_; ++i)
      z[i] = random::uniform(settings_.seed, 430 + static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(p));
    z = settable(z);
    at.tail(inputs_) = unscaled(z);
    double over = 0.0;
    for (std::size_t i = 0; i < settings_.limit_guides.size(); ++i) {
      if (settings_.limit_guides[i].empty()) continue;
      const Limit& limit = settings_.limits[i];
      over = std::max(over, (settings_.limit_guides[i](at) + limit.margin - limit.upper) / limit.scale + first_room);
    }
    const double j = (settings_.maximize ? 1.0 : -1.0) * settings_.guide[0](at);
    if (over > least_over || (over == least_over && j <= most)) continue;
    most = j;
    least_over = over;
    best = z;
  }
  return best;
}

// At the point in the middle; without a guide then a step of every input there, and the farthest points to the sides.
void MapSeeking::first_visit() noexcept {
  const auto cells_of = all_cells();
  const auto middle = std::ranges::min_element(
      cells_of, {}, [](const Place& place) { return (place.context.array() - 0.5).matrix().squaredNorm(); });
  std::size_t at = static_cast<std::size_t>(middle - cells_of.begin());
  Inputs z = first_input(cell(at));
  const auto side = static_cast<Eigen::Index>(told_ % (1 + context_ + inputs_)) - 1;
  if (side >= 0 && side < inputs_) {
    z[side] += z[side] > 0.5 ? -first_step : first_step;
  } else if (side >= inputs_) {
    double farthest = 0.0;
    for (std::size_t c = 0; c < cells(); ++c) {
      const Inputs off = (places_[c].context - middle->context).cwiseAbs();
      const double along = off[side - inputs_];
      if (off.sum() > along || along <= farthest) continue;
      farthest = along;
      at = c;
    }
  }
  visit_ = {cell(at), unscaled(settable(z))};
}

// The best input of a cell, the most promising one, the least known one, those at the ends, and some from everywhere.
int MapSeeking::visits_of(std::size_t c, std::span<int> out) const noexcept {
  const int best = point_of(c, 0);
  std::size_t count = 0;
  const auto take = [&](int p) {
    const auto taken = out.first(count);
    if (p >= 0 && count < out.size() && std::ranges::find(taken, p) == taken.end()) out[count++] = p;
  };
  int promise = -1, widest = -1, first = -1, last = -1;
  double most = 0.0, wide = 0.0;
  for (int k = 0; k < per_place; ++k) {
    const int p = point_of(c, k);
    if (!safe(p, places_[c])) continue;
    const double sd = j_.sd(p), hope = worth(p) + promising * sd;
    if (promise < 0 || hope > most) {
      most = hope;
      promise = p;
    }
    if (widest < 0 || sd > wide) {
      wide = sd;
      widest = p;
    }
    if (first < 0 || candidates_(p, context_) < candidates_(first, context_)) first = p;
    if (last < 0 || candidates_(p, context_) > candidates_(last, context_)) last = p;
  }
  if (promise < 0) return 0;
  if (safe(best, places_[c])) take(best);
  for (const int p : {promise, widest, first, last})
    take(p);
  for (int k = 0; k < per_place; ++k) {
    const int p = point_of(c, static_cast<int>(uniform(440, static_cast<int>(c) * per_place + k) * per_place));
    if (safe(p, places_[c])) take(p);
  }
  return static_cast<int>(count);
}

// By what a reading at a candidate, of those covariances with all that are safe, is expected to raise the J of all
// cells.
double MapSeeking::gain_of(int point, const double* covariances) noexcept {
  const double sd = std::hypot(j_.sd(point), j_.noise_sd() / std::sqrt(settings_.averaged));
  if (!(sd > 0.0)) return 0.0;
  double out = 0.0;
  for (std::size_t c = 0; c < cells(); ++c) {
    const auto from = static_cast<std::size_t>(safe_from_[c]), n = static_cast<std::size_t>(safe_from_[c + 1]) - from;
    const std::span<double> means(worth_.mean.data(), n), effects(worth_.effect.data(), n);
    for (std::size_t k = 0; k < n; ++k) {
      means[k] = worth(safe_[from + k]);
      effects[k] = covariances[from + k] / sd;
    }
    const auto [least, most] = std::ranges::minmax(effects);
    if (most - least < least_effect * sd) continue;
    out += knowledge_gradient(means, effects, {worth_.order.data(), n}, {worth_.breaks.data(), n});
  }
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    const ProcessModel& model = limited_[i].model();
    const double reading = std::pow(model.sd(point), 2.0) + std::pow(model.noise_sd(), 2.0) / settings_.averaged;
    if (!(reading > 0.0)) continue;
    for (std::size_t c = 0; c < cells(); ++c) {
      const double multiplier = multipliers_[c * limited_.size() + i];
      if (!(multiplier > 0.0)) continue;
      const int best = point_of(c, 0);
      const double doubt = model.sd(best), both = model.covariance(best, point);
      if (!(doubt > 0.0)) continue;
      const double left = std::sqrt(std::max(1.0 - both * both / (reading * doubt * doubt), 0.0));
      out += multiplier * quantile_ * limited_[i].sd(best) * (1.0 - left);
    }
  }
  return out;
}

// Of a cell where nothing may be asked the input that most likely keeps the limits, as all do a standard deviation
// above their means, or if that is dared their means; -1 without one.
int MapSeeking::surest(std::size_t c, bool dare) const noexcept {
  int out = -1;
  for (int k = 0; k < per_place; ++k) {
    const int p = point_of(c, k);
    if (!within_reach(p)) continue;
    const auto broken = [&](const LimitProcess& one) {
      return one.excess(p, 0.0) + (dare ? 0.0 : one.sd(p) / one.widening()) > 0.0;
    };
    if (std::ranges::any_of(limited_, broken)) continue;
    if (out < 0 || odds_[static_cast<std::size_t>(p)] < odds_[static_cast<std::size_t>(out)]) out = p;
  }
  return out;
}

// Where what is believed has not been put to the test: where nothing may be asked, where the first visit failed and, if
// that is dared, where nothing was read; the cell farthest from all that were read before those that were, of these the
// least read; -1 where there is none.
int MapSeeking::untried(bool dare) const noexcept {
  const auto apart = [this](std::size_t c) {
    double out = std::numeric_limits<double>::infinity();
    for (std::size_t other = 0; other < cells(); ++other) {
      if (read_[other] > 0.0) out = std::min(out, (places_[other].context - places_[c].context).squaredNorm());
    }
    return out;
  };
  int out = -1;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < cells(); ++c) {
    const bool open = places_[c].visit >= 0, doubted = read_[c] == 0.0 && (dare || failures_[c] > 0.0);
    if (failures_[c] >= given_up || (open && !doubted)) continue;
    const double own = read_[c] > 0.0 ? -read_[c] : apart(c);
    if (own <= most) continue;
    const int p = open ? places_[c].visit : surest(c, dare);
    if (p < 0) continue;
    out = p;
    most = own;
  }
  return out;
}

const MapSeeking::Visit& MapSeeking::suggest() noexcept {
  if (cells() == 0) return visit_;
  if (!known()) {
    first_visit();
    return visit_;
  }
  know_cells();
  suggested_ = true;
  if (again_ > 0) {  // nothing is learnt of the map, but whether the reading was right
    put(0, scaled_context(last_context_), scaled(last_input_));
    j_.predict(candidates_, 1);
    searched_ = false;
    const Inputs within = last_input_.cwiseMax(settings_.space.lower).cwiseMin(settings_.space.upper);
    visit_ = {last_context_, within, 0.0, j_.sd(0)};
    return visit_;
  }
  const std::span<const int> all_safe(safe_.data(), static_cast<std::size_t>(safe_from_[cells()]));
  double most = -1.0;
  int next = -1;
  for (std::size_t c = 0; c < cells(); ++c) {
    places_[c].visit = -1;
    if (failures_[c] >= given_up) continue;
    std::array<int, most_visits> visits{};
    const int count = visits_of(c, visits);
    double largest = -1.0;
    j_.covariances(std::span(visits).first(static_cast<std::size_t>(count)), all_safe, effects_);
    const bool elsewhere = (cell(c) - last_context_).cwiseAbs().maxCoeff() > 0.0;
    const double works = std::pow(by_chance, failures_[c]);  // that a cell which has failed so often does
    const double counts = elsewhere ? works / (1.0 + settings_.moving_cost) : works;
    for (int k = 0; k < count; ++k) {
      const int p = visits[static_cast<std::size_t>(k)];
      const double gain = gain_of(p, &effects_(k, 0));
      if (gain > largest) {
        largest = gain;
        places_[c].visit = p;
      }
      if (counts * gain <= most) continue;
      most = counts * gain;
      next = p;
      visit_.gain = gain;
    }
  }
  const double nothing = little * (j_.highest() - j_.lowest());
  const double noise = std::max(j_.noise_sd() / std::sqrt(settings_.averaged), nothing);
  const bool grown = static_cast<double>(told_) >= cautious_readings * static_cast<double>(1 + context_ + inputs_);
  const int other = next >= 0 && visit_.gain < noise ? untried(grown && visit_.gain < nothing) : -1;
  if (next < 0 || other >= 0) {
    next = next < 0 ? least_unsafe(all_cells()) : other;
    visit_.gain = 0.0;
  }
  visit_.sd = j_.sd(next);
  visit_.context = cell(place_of(next));
  visit_.input = unscaled(candidates_.row(next).tail(inputs_).transpose());
  return visit_;
}

const Inputs& MapSeeking::ask(const Inputs& context) noexcept {
  Place& here = places_.back();
  const Inputs at = scaled_context(context);
  if (!known()) {
    Inputs z = first_input(context);
    const auto side = static_cast<Eigen::Index>(told_ % (1 + inputs_)) - 1;
    if (side >= 0) z[side] += z[side] > 0.5 ? -first_step : first_step;
    asked_ = unscaled(settable(z));
    return asked_;
  }
  if ((at - here.context).cwiseAbs().maxCoeff() > 0.0 && cells() > 0) {
    here.from = std::ranges::min_element(all_cells(), {}, [&](const Place& place) {
                  return (place.context - at).squaredNorm();
                })->from;
  }
  here.context = at;
  const std::span<Place> places(&here, 1);
  search(places);
  searched_ = false;
  int count = 0;
  for (int p = 0; p < per_place; ++p) {
    if (safe(p, here)) safe_[static_cast<std::size_t>(count++)] = p;
  }
  int next = 0;
  if (count == 0) {
    next = least_unsafe(places);
  } else {
    std::array<int, per_place> all{};
    std::iota(all.begin(), all.end(), 0);
    j_.covariances(all, all, joint_);
    const double noise = std::max(j_.noise_sd(), worth_noise * std::abs(j_.mean(0)));
    const double read = static_cast<double>(j_.count()) / (cautious_readings * static_cast<double>(1 + inputs_));
    next = most_worth(
        {safe_.data(), static_cast<std::size_t>(count)}, [this](int p) { return worth(p); },
        [this](int p, int q) { return joint_(p, q); }, noise, settings_.horizon * std::min(1.0, read), worth_);
  }
  asked_ = unscaled(candidates_.row(next).tail(inputs_).transpose());
  return asked_;
}

}  // namespace mgdd::optimize
