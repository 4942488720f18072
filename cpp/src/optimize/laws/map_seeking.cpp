#include "mgdd/optimize/laws/map_seeking.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
namespace {

constexpr double alike = 0.01;  // ranges: readings closer than that are averaged
// What a cycle model misses of what it models, before readings: a thirtieth of its bends, a fifth of its size, a tenth
// of the bounds in its place. It holds that much over all points; wider ones let the first readings explore for
// nothing.
constexpr double missed = -3.5, missed_sd = 1.0, rest = -3.0, factor_sd = 0.2, place_sd = 0.1;
constexpr double powers = 10.0;             // that a limit spans, for its logarithm
constexpr std::int64_t calm_readings = 10;  // after a doubt
constexpr std::size_t most_cells = 10'000;

ProcessModel::Settings map_process_settings(const MapSeekingSettings& s, int most_points) {
  ProcessModel::Settings out;
  out.context = static_cast<Eigen::Index>(s.context.size());
  out.inputs = out.context + s.space.size();
  out.kept = s.kept;
  out.most_points = most_points;
  out.memory = s.memory_readings;
  out.seed = s.seed;
  out.alike = alike;
  Inputs lower(out.inputs), upper(out.inputs);
  for (Eigen::Index i = 0; i < out.context; ++i) {
    lower[i] = s.context[static_cast<std::size_t>(i)].lower;
    upper[i] = s.context[static_cast<std::size_t>(i)].upper;
  }
  lower.tail(s.space.size()) = s.space.lower;
  upper.tail(s.space.size()) = s.space.upper;
  out.guide = {{}, lower, upper, 1.0, factor_sd, place_sd};
  if (!s.guide.empty()) {
    out.missed = missed;
    out.missed_sd = missed_sd;
    out.rest = rest;
  }
  return out;
}

ProcessModel j_process(const MapSeekingSettings& s, int most_points) {
  ProcessModel::Settings out = map_process_settings(s, most_points);
  out.noise_sd = s.noise_sd;
  out.repeated = true;
  if (!s.guide.empty()) out.guide.surface = s.guide[0];
  out.guide.sign = s.maximize ? 1.0 : -1.0;
  return ProcessModel(out);
}

std::vector<LimitProcess> map_limit_processes(const MapSeekingSettings& s, int most_points) {
  std::vector<LimitProcess> out;
  for (std::size_t i = 0; i < s.limits.size(); ++i) {
    const Surface guide = s.limit_guides.empty() ? Surface{} : s.limit_guides[i];
    ProcessModel::Settings own = map_process_settings(s, most_points);
    own.guide.secant = place_sd;  // its kinks, as where combustion outgrows compression, move with the rest
    out.emplace_back(s.limits[i], own, guide, 0, powers);
  }
  return out;
}

std::size_t count_of(const std::vector<std::vector<double>>& axes) {
  std::size_t out = axes.empty() ? 0 : 1;
  for (const auto& axis : axes)
    out *= axis.size();
  return out;
}

// Of all places, with those that a climb tries.
int points_of(const MapSeekingSettings& s, int per_place) {
  const int tried = std::max(1 + 2 * static_cast<int>(s.space.size()), Climb::tries);
  return (per_place + tried) * static_cast<int>(std::max<std::size_t>(1, count_of(s.axes)));
}

void require_axes(const MapSeekingSettings& s) {
  if (s.axes.empty()) return;
  if (s.axes.size() != s.context.size()) {
    throw about("axes", ShapeError("axes has " + std::to_string(s.axes.size()) +
                                   " entries: must have one per context, " + std::to_string(s.context.size())));
  }
  for (std::size_t i = 0; i < s.axes.size(); ++i) {
    const Input& own = s.context[i];
    if (s.axes[i].empty()) throw about("axes", ShapeError("axes of " + own.name + " is empty: give its entries"));
    for (std::size_t k = 0; k < s.axes[i].size(); ++k) {
      const double entry = s.axes[i][k];
      if (!(entry >= own.lower && entry <= own.upper)) {
        throw ParameterError("axes of " + own.name, entry, "must lie within the bounds of the context");
      }
      if (k > 0 && !(entry > s.axes[i][k - 1])) throw ParameterError("axes of " + own.name, entry, "must increase");
    }
  }
  if (count_of(s.axes) > most_cells) {
    throw about("axes", ShapeError("axes make " + std::to_string(count_of(s.axes)) + " cells: at most " +
                                   std::to_string(most_cells)));
  }
}

}  // namespace

MapSeekingSettings resolved(MapSeekingSettings s) {
  s.space = resolved(std::move(s.space));
  validate(s.space, Inputs::Zero(s.space.size()));
  require_finite_bounds(s.space);
  if (s.context.empty()) throw about("context", ShapeError("context is empty: name what makes an operating point"));
  validate(s.context);
  for (const Input& one : s.context) {
    if (!std::isfinite(one.lower)) throw ParameterError("lower of " + one.name, one.lower, "must be finite");
    if (!std::isfinite(one.upper)) throw ParameterError("upper of " + one.name, one.upper, "must be finite");
  }
  const auto all = static_cast<Eigen::Index>(s.context.size()) + s.space.size();
  if (all > max_inputs) {
    throw about("context", ShapeError("context and inputs are " + std::to_string(all) + " together: at most " +
                                      std::to_string(max_inputs)));
  }
  require_axes(s);
  if (s.noise_sd) require_positive("noise_sd", *s.noise_sd);
  require_in(Domain{0.0, 1e6}, "horizon", s.horizon);
  require_in(Domain{1.0, 1e6}, "averaged", s.averaged);
  require_in(Domain{0.0, 1e6}, "moving_cost", s.moving_cost);
  require_in(Domain{10.0, 1e9}, "memory_readings", s.memory_readings);
  require_in(Domain{10.0, most_kept}, "kept", s.kept);
  require_in(closed(0.0, 1e12), "smoothness", s.smoothness);
  require_in(Domain{1e-3, 1.0}, "reach", s.reach);
  require_in(Domain{0.5, 0.9999}, "limit_probability", s.limit_probability);
  validate(s.limits);
  for (Limit& limit : s.limits) {
    if (limit.scale == 0.0) limit.scale = limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
  }
  require_guides("guide", s.guide, 1, "objective", all);
  require_guides("limit_guides", s.limit_guides, s.limits.size(), "limit", all);
  return s;
}

MapSeeking::MapSeeking(MapSeekingSettings settings)
    : settings_(resolved(std::move(settings))),
      quantile_(random::normal_quantile(settings_.limit_probability)),
      cautious_quantile_(random::normal_quantile(1.0 - (1.0 - settings_.limit_probability) / cautious_cycles)),
      context_(static_cast<Eigen::Index>(settings_.context.size())),
      inputs_(settings_.space.size()),
      steps_(steps_of(settings_.space.inputs)),
      j_(j_process(settings_, points_of(settings_, per_place))),
      limited_(map_limit_processes(settings_, points_of(settings_, per_place))),
      failing_(map_process_settings(settings_, points_of(settings_, per_place))),
      places_(count_of(settings_.axes) + 1),
      failures_(cells(), 0.0),
      read_(cells(), 0.0),
      lowest_(scaled(settings_.space.start)),
      highest_(lowest_),
      last_context_(Inputs::Zero(context_)),
      last_input_(settings_.space.start),
      visit_{Inputs::Zero(context_), settings_.space.start},
      asked_(settings_.space.start),
      candidates_(InputTable::Zero(points_of(settings_, per_place), context_ + inputs_)),
      multipliers_(places_.size() * limited_.size(), 0.0),
      edge_over_(limited_.size(), 0.0),
      nearest_(limited_.size()),
      edges_(InputTable::Zero(static_cast<Eigen::Index>(multipliers_.size()), inputs_)),
      excess_(InputTable::Zero(static_cast<Eigen::Index>(limited_.size()), candidates_.rows())),
      joint_(per_place, per_place),
      effects_(most_visits, candidates_.rows()),
      worth_(per_place) {
  for (std::size_t c = 0; c < places_.size(); ++c)
    places_[c] = {c < cells() ? scaled_context(cell(c)) : Inputs(Inputs::Zero(context_)), lowest_, lowest_};
  const auto points = static_cast<std::size_t>(candidates_.rows());
  for (std::vector<double>* one : {&over_, &cautious_, &mean_over_, &odds_, &rough_})
    one->assign(points, 0.0);
  safe_.assign(points, 0);
  safe_from_.assign(places_.size() + 1, 0);
  bends_ = bends_of_cells();
  aside_ = Inputs::Constant(inputs_, slope_step);
  if (steps_.any()) aside_ = aside_.cwiseMax(steps_.size.cwiseQuotient(settings_.space.upper - settings_.space.lower));
}

std::vector<std::vector<MapSeeking::Bend>> MapSeeking::bends_of_cells() const {
  std::vector<std::vector<Bend>> out(places_.size());
  if (settings_.smoothness == 0.0) return out;
  std::size_t stride = cells();
  for (const auto& axis : settings_.axes) {
    stride /= axis.size();
    const double mean_step = (axis.back() - axis.front()) / static_cast<double>(axis.size() - 1);
    for (std::size_t c = 0; c < cells(); ++c) {
      const std::size_t k = c / stride % axis.size();
      if (k == 0 || k + 1 == axis.size()) continue;
      const double before = (axis[k] - axis[k - 1]) / mean_step, after = (axis[k + 1] - axis[k]) / mean_step;
      const double both = 0.5 * (before + after), left = 1.0 / (before * both), right = 1.0 / (after * both);
      const double middle = -2.0 / (before * after);
      const std::size_t low = c - stride, high = c + stride;
      out[low].push_back({left, {c, high}, {middle, right}});
      out[c].push_back({middle, {low, high}, {left, right}});
      out[high].push_back({right, {low, c}, {left, middle}});
    }
  }
  return out;
}

Inputs MapSeeking::cell(std::size_t c) const noexcept {
  Inputs out(context_);
  for (Eigen::Index i = context_ - 1; i >= 0; --i) {
    const auto& axis = settings_.axes[static_cast<std::size_t>(i)];
    out[i] = axis[c % axis.size()];
    c /= axis.size();
  }
  return out;
}

Inputs MapSeeking::scaled_context(const Inputs& context) const noexcept {
  Inputs out(context_);
  for (Eigen::Index i = 0; i < context_; ++i) {
    const Input& own = settings_.context[static_cast<std::size_t>(i)];
    out[i] = (context[i] - own.lower) / (own.upper - own.lower);
  }
  return out;
}

Inputs MapSeeking::scaled(const Inputs& input) const noexcept {
  return (input - settings_.space.lower).cwiseQuotient(settings_.space.upper - settings_.space.lower);
}

Inputs MapSeeking::unscaled(const Inputs& z) const noexcept {
  return settings_.space.lower + z.cwiseProduct(settings_.space.upper - settings_.space.lower);
}

// The nearest input within the bounds, in whole steps where it has some.
Inputs MapSeeking::settable(const Inputs& z) const noexcept {
  Inputs within = z.cwiseMax(0.0).cwiseMin(1.0);
  if (!steps_.any()) return within;
  return scaled(steps_.nearest(unscaled(within), [](const Inputs&) { return 0.0; }));
}

// Once there are as many readings as numbers.
bool MapSeeking::known() const noexcept {
  const auto enough = [](const ProcessModel& model) { return model.count() >= model.fewest(); };
  return enough(j_) && std::ranges::all_of(limited_, [&](const LimitProcess& one) { return enough(one.model()); });
}

TellStatus MapSeeking::tell(const Inputs& context, const Inputs& input, const Reading& reading, double readings,
                            std::span<const double> sd) noexcept {
  if (!reading.misfire) {
    if (reading.components.size() != 1) return TellStatus::wrong_component_count;
    if (reading.limits.size() != limited_.size()) return TellStatus::wrong_limit_count;
    if (!is_reading(reading.components[0])) return TellStatus::not_a_reading;
    if (!std::ranges::all_of(reading.limits, is_reading)) return TellStatus::not_a_reading;
  }
  Inputs z(context_ + inputs_);
  z.head(context_) = scaled_context(context);
  z.tail(inputs_) = scaled(input);
  last_context_ = context;
  last_input_ = input;
  ++told_;
  searched_ = false;
  for (Place& place : places_) {
    if (suggested_ || &place == &places_.back()) place.from = place.best;
  }
  suggested_ = false;
  bool of_cell = false;
  for (std::size_t c = 0; c < cells(); ++c) {
    if (cell(c) != context) continue;
    of_cell = true;
    failures_[c] = reading.misfire ? failures_[c] + 1.0 : 0.0;
    if (!reading.misfire) read_[c] += 1.0;
  }
  failing_.record(z, !reading.misfire, z);
  failing_.fit(z);
  if (reading.misfire) {
    again_ = 0;
    return TellStatus::misfire;
  }
  lowest_ = j_.count() == 0 ? Inputs(z.tail(inputs_)) : lowest_.cwiseMin(z.tail(inputs_));
  highest_ = j_.count() == 0 ? lowest_ : highest_.cwiseMax(z.tail(inputs_));
  const auto scatter = [&](std::size_t channel) { return channel < sd.size() ? sd[channel] : 0.0; };
  j_.scattered(scatter(0), readings);
  const double odd = j_.record(z, settings_.maximize ? reading.components[0] : -reading.components[0], z, readings);
  const bool surprising = surprise_.add(odd);
  again_ = of_cell && odd > odd_visit && again_ < most_again ? again_ + 1 : 0;
  for (std::size_t i = 0; i < limited_.size(); ++i)
    limited_[i].record(z, reading.limits[i], z, readings, scatter(1 + i));
  if (++since_doubt_ >= calm_readings && surprising) {
    j_.age(doubt_age * settings_.memory_readings);
    surprise_.reset();
    since_doubt_ = 0;
    ++doubts_;
  }
  if (!known()) return TellStatus::accepted;
  j_.fit(z);
  for (LimitProcess& limited : limited_)
    limited.model().fit(z);
  return TellStatus::accepted;
}

void MapSeeking::reseed(std::uint64_t seed) noexcept {
  settings_.seed = seed;
  j_.reseed(seed);
  for (LimitProcess& limited : limited_)
    limited.model().reseed(seed);
  failing_.reseed(seed);
  searched_ = false;
}

void MapSeeking::require_usable() const {
  failing_.require_usable();
  j_.require_usable();
  for (const LimitProcess& limited : limited_)
    limited.model().require_usable();
  for (const double failures : failures_)
    require_in(closed(0.0, 1e12), "failures", failures);
  for (const double read : read_)
    require_in(closed(0.0, 1e12), "read", read);
  for (const Place& place : places_) {
    for (const double entry : place.from)
      require_in(closed(0.0, 1.0), "place", entry);
  }
}

}  // namespace mgdd::optimize
