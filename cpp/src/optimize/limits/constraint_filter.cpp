#include "mgdd/optimize/limits/constraint_filter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double significance = 2.0;        // standard errors
constexpr double patience_share = 0.6;      // of the memory: how long the search waits for the slope of a limit
constexpr double most_extra = 5.0;          // scatters: what integral action adds to a margin at most
constexpr double alarm_cycles = 3.0;        // in a row over the limit
constexpr double contradicted_steps = 3.0;  // in a row: infeasible
constexpr double lag_memory = 4.0;          // time constants
constexpr double binding_room = 1e-6;       // scales: no room
constexpr double rounding = 1e-9;           // scales: less is not over a limit
constexpr double barrier_edge = 0.01;       // scaled distance where the logarithm goes on as its tangent

/// The largest share of a step, at most 1, with which every entry stays within `most`.
double share_within(const Inputs& step, const Inputs& most) noexcept {
  double share = 1.0;
  for (Eigen::Index i = 0; i < step.size(); ++i) {
    if (std::abs(step[i]) > most[i]) share = std::min(share, most[i] / std::abs(step[i]));
  }
  return share;
}

}  // namespace

void validate(const std::vector<Limit>& limits) {
  for (const Limit& limit : limits) {
    const std::string at = "limit " + limit.name + ": ";
    if (limit.name.empty()) throw about("limit", ParameterError("limit: name is empty: say what is limited"));
    if (std::count_if(limits.begin(), limits.end(), [&](const Limit& l) { return l.name == limit.name; }) > 1) {
      throw ParameterError(at + "is given twice: give it once");
    }
    if (!std::isfinite(limit.upper)) throw in_context(at, ParameterError("upper", limit.upper, "must be finite"));
    if (!(limit.margin >= 0.0 && std::isfinite(limit.margin))) {
      throw in_context(at, ParameterError("margin", limit.margin, "must be >= 0 and finite"));
    }
    if (!(limit.weight > 0.0 && std::isfinite(limit.weight))) {
      throw in_context(at, ParameterError("weight", limit.weight, "must be > 0 and finite"));
    }
    if (!(limit.margin_sd >= 0.0 && limit.margin_sd <= 100.0)) {
      throw in_context(at, ParameterError("margin_sd", limit.margin_sd, "must lie in [0, 100]"));
    }
    validate(limit.lag, at);
    if (limit.delay_uncertainty < 0 || limit.delay_uncertainty > 20) {
      throw in_context(at, ParameterError("delay_uncertainty", limit.delay_uncertainty, "must lie in [0, 20] cycles"));
    }
    if (!(limit.scale >= 0.0 && std::isfinite(limit.scale))) {
      throw in_context(at, ParameterError("scale", limit.scale, "must be >= 0 (0: the limit itself) and finite"));
    }
  }
}

std::vector<UncertainLag> lags_of(const std::vector<Limit>& limits, double memory) {
  validate(limits);
  std::vector<UncertainLag> out;
  for (const Limit& limit : limits)
    out.push_back({limit.lag, limit.delay_uncertainty, memory + lag_memory * limit.lag.lag_cycles});
  return out;
}

void learn_excess(double& extra, const Limit& limit, double reading, double scatter, double memory) noexcept {
  const double expected = 0.5 * std::erfc(limit.margin_sd / std::numbers::sqrt2);  // at the edge of the margin
  const double over = reading > limit.upper - limit.margin ? 1.0 : 0.0;
  extra = std::clamp(extra + (over - expected) * scatter / memory, 0.0, most_extra * scatter);
}

ConstraintFilter::ConstraintFilter(std::vector<Limit> limits, Eigen::Index inputs, double memory)
    : limits_(std::move(limits)),
      causes_(lags_of(limits_, memory), inputs),
      memory_(memory),
      patience_(patience_share * memory),
      extra_(limits_.size(), 0.0),
      in_a_row_(extra_),
      binding_(in_a_row_),
      contradicted_(in_a_row_),
      slopes_(limits_.size(), Inputs::Zero(inputs)),
      over_(limits_.size(), 0.0),
      nearest_(limits_.size()),
      good_(Inputs::Zero(inputs)) {
  for (Limit& limit : limits_) {
    models_.emplace_back(inputs, memory + lag_memory * limit.lag.lag_cycles);
    if (limit.scale == 0.0) limit.scale = limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
  }
}

void ConstraintFilter::record(const Inputs& applied, std::span<const double> values) noexcept {
  if (limits_.empty()) return;
  causes_.record(applied);
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    if (!causes_.known(i)) continue;
    models_[i].record(causes_.of(i, applied), values[i]);
    if (causes_.judge(i, applied, values[i])) models_[i] = causes_.model(i);
    learn_excess(extra_[i], limits_[i], values[i], models_[i].scatter(), memory_);
    in_a_row_[i] = values[i] > limits_[i].upper - limits_[i].margin ? in_a_row_[i] + 1.0 : 0.0;
  }
}

double ConstraintFilter::shaping(const Inputs& applied, std::span<const double> values) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const Limit& limit = limits_[i];
    if (limit.method == LimitMethod::switching) continue;
    const bool late = !causes_.direct(i);
    if (late && !(models_[i].cycles() > 0.0)) continue;
    const double value = late ? models_[i].predict(applied) : values[i];
    const double over = (value + margin(i) - limit.upper) / limit.scale;
    if (limit.method == LimitMethod::penalty && over > 0.0) sum -= limit.weight * over * over;
    if (limit.method == LimitMethod::barrier) {
      const double room = std::max(-over, barrier_edge);
      sum += limit.weight * (std::log(room) + std::min(0.0, -over - room) / barrier_edge);
    }
  }
  return sum;
}

double ConstraintFilter::excess(std::size_t i, const Inputs& at, const Inputs& reach) const noexcept {
  if (!(models_[i].cycles() > 0.0)) return -unlimited;
  return models_[i].predict(at) + models_[i].slope().cwiseAbs().dot(reach) + margin(i) - limits_[i].upper;
}

double ConstraintFilter::worst_excess(const Inputs& at) const noexcept {
  double worst = -unlimited;
  for (std::size_t i = 0; i < limits_.size(); ++i)
    worst = std::max(worst, excess(i, at, Inputs::Zero(at.size())) / limits_[i].scale);
  return worst;
}

double ConstraintFilter::margin(std::size_t i) const noexcept {
  const double scatter = limits_[i].margin_sd > 0.0 ? limits_[i].margin_sd * models_[i].scatter() : 0.0;
  return limits_[i].margin + scatter + extra_[i];
}

LimitState ConstraintFilter::state(std::size_t i) const noexcept {
  if (contradicted_[i] >= contradicted_steps) return LimitState::infeasible;
  return binding_[i] > 0.0 ? LimitState::active : LimitState::free;
}

Inputs ConstraintFilter::project(const Inputs& estimate, const Inputs& step, const StepFrame& frame) noexcept {
  Inputs wish = step;
  if (active_) {  // along a limit the step keeps its direction
    wish *= share_within(step, frame.rate);
  } else {
    clip_each(wish, frame.rate);
  }
  active_ = false;
  if (limits_.empty()) return wish;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    if (models_[i].cycles() > 0.0) continue;
    if (causes_.direct(i)) return wish;
    if (!frame.reach.isZero(0.0)) return Inputs::Zero(step.size());
  }
  std::size_t worst = 0;
  double worst_excess = -unlimited;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    slopes_[i] = models_[i].slope();
    over_[i] = excess(i, estimate, frame.reach);
    binding_[i] = over_[i] > -binding_room * limits_[i].scale ? 1.0 : 0.0;
    if (over_[i] / limits_[i].scale > worst_excess) {
      worst_excess = over_[i] / limits_[i].scale;
      worst = i;
    }
  }
  if (worst_excess > 0.0) {
    active_ = true;
    if (models_[worst].slope_known(significance)) return turn(estimate, step, frame, worst_excess);
    if (has_good_ && good_ != estimate) {
      wish = good_ - estimate;
      clip_each(wish, frame.rate.cwiseMax(frame.recovery));
    } else if (!frame.reach.isZero(0.0) && models_[worst].cycles() < patience_) {
      wish.setZero();
    }  // else the steps go on: they may be the only dither, or no slope may ever show
    return admits(wish) ? wish : turn(estimate, wish, frame, worst_excess);
  }
  good_ = estimate;
  has_good_ = true;
  std::fill(contradicted_.begin(), contradicted_.end(), 0.0);
  if (admits(wish)) return wish;
  active_ = true;
  return turn(estimate, step, frame, worst_excess);
}

// True where the step makes no broken limit worse and breaks no other; one that says nothing is not asked.
bool ConstraintFilter::admits(const Inputs& step) const noexcept {
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const double room = std::max(0.0, -over_[i]);
    if (slopes_[i].dot(step) > room + rounding * limits_[i].scale && !silent(i, over_[i])) return false;
  }
  return true;
}

// Wish and answer are made shorter, not cut entry by entry: what is cut does not point along the limits any more.
Inputs ConstraintFilter::turn(const Inputs& estimate, const Inputs& step, const StepFrame& frame,
                              double worst_excess) noexcept {
  const SearchSpace& space = frame.space;
  nearest_.begin(step * share_within(step, frame.rate), frame.metric, space.lower + frame.margin - estimate,
                 space.upper - frame.margin - estimate);
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    if (silent(i, over_[i])) continue;
    const bool back = over_[i] > 0.0 && models_[i].slope_known(significance);
    nearest_.add(slopes_[i], back ? -over_[i] : std::max(0.0, -over_[i]), limits_[i].scale);
  }
  const double relaxation = nearest_.solve(worst_excess);
  const Inputs& out = nearest_.step();
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const double left = -over_[i] - slopes_[i].dot(out), least = binding_room * limits_[i].scale;
    if (slopes_[i].squaredNorm() > 0.0 && left < least) binding_[i] = 1.0;
    const double reached = slopes_[i].cwiseAbs().dot(frame.reach);  // by the dither, which may shrink
    contradicted_[i] = relaxation > 0.0 && left + reached < -least ? contradicted_[i] + 1.0 : 0.0;
  }
  double share = share_within(out, frame.rate.cwiseMax(frame.recovery));
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const double rise = slopes_[i].dot(out), room = -over_[i];
    const double allowed = room + relaxation * limits_[i].scale;
    if (room > 0.0 && rise > allowed + rounding * limits_[i].scale) share = std::min(share, allowed / rise);
  }
  return out * share;
}

// Broken, looked at for long, and without a slope that stands out of its noise: it cannot say where to go.
bool ConstraintFilter::silent(std::size_t i, double excess) const noexcept {
  return excess > 0.0 && models_[i].cycles() >= patience_ && !models_[i].slope_known(significance);
}

bool ConstraintFilter::alarmed() const noexcept {
  return std::any_of(in_a_row_.begin(), in_a_row_.end(), [](double n) { return n >= alarm_cycles; });
}

void ConstraintFilter::forget() noexcept {
  for (LocalModel& model : models_)
    model.forget();
  causes_.forget();
  for (std::vector<double>* const column : {&extra_, &in_a_row_, &binding_, &contradicted_})
    std::fill(column->begin(), column->end(), 0.0);
  has_good_ = false;
  active_ = false;
}

}  // namespace mgdd::optimize
