#include "mgdd/optimize/seekers/constraint_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr std::array<std::pair<LimitMethod, std::string_view>, 3> method_names{{
    {LimitMethod::switching, "switching"},
    {LimitMethod::penalty, "penalty"},
    {LimitMethod::barrier, "barrier"},
}};

constexpr double significance = 2.0;    // standard errors
constexpr double patience_share = 0.6;  // of the memory, before a limit without a slope is no longer waited for
constexpr double alarm_cycles = 3.0;    // in a row over the limit
constexpr double barrier_edge = 0.01;   // scaled distance where the logarithm goes on as its tangent

}  // namespace

std::string_view to_string(LimitMethod v) noexcept {
  return name_of<LimitMethod>(method_names, v);
}
LimitMethod parse_limit_method(std::string_view name) {
  return parse_name<LimitMethod>(method_names, "method", name);
}

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
    if (!(limit.scale >= 0.0 && std::isfinite(limit.scale))) {
      throw in_context(at, ParameterError("scale", limit.scale, "must be >= 0 (0: the limit itself) and finite"));
    }
  }
}

ConstraintFilter::ConstraintFilter(std::vector<Limit> limits, Eigen::Index inputs, double memory)
    : limits_(std::move(limits)),
      patience_(patience_share * memory),
      models_(limits_.size(), LocalModel(inputs, memory)),
      in_a_row_(limits_.size(), 0.0),
      good_(Inputs::Zero(inputs)) {
  validate(limits_);
  for (Limit& limit : limits_) {
    if (limit.scale == 0.0) limit.scale = limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
  }
}

void ConstraintFilter::record(const Inputs& applied, std::span<const double> values) noexcept {
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    models_[i].record(applied, values[i]);
    in_a_row_[i] = values[i] > limits_[i].upper - limits_[i].margin ? in_a_row_[i] + 1.0 : 0.0;
  }
}

double ConstraintFilter::shaping(std::span<const double> values) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const Limit& limit = limits_[i];
    const double over = (values[i] + limit.margin - limit.upper) / limit.scale;
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
  return models_[i].predict(at) + models_[i].slope().cwiseAbs().dot(reach) + limits_[i].margin - limits_[i].upper;
}

Inputs ConstraintFilter::project(const Inputs& estimate, const Inputs& step, const Inputs& reach,
                                 const Inputs& rate) noexcept {
  active_ = false;
  if (limits_.empty() || !(models_.front().cycles() > 0.0)) return step;
  std::size_t worst = 0;
  double worst_excess = -unlimited;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const double scaled = excess(i, estimate, reach) / limits_[i].scale;
    if (scaled > worst_excess) {
      worst_excess = scaled;
      worst = i;
    }
  }
  Inputs out = step;
  if (worst_excess > 0.0) {
    active_ = true;
    if (models_[worst].slope_known(significance)) {
      const Inputs s = models_[worst].slope();
      const double over = worst_excess * limits_[worst].scale;
      out = step - s * ((s.dot(step) + over) / s.squaredNorm());
    } else if (has_good_ && good_ != estimate) {
      out = good_ - estimate;
    } else if (!reach.isZero(0.0) && models_[worst].cycles() < patience_) {
      out.setZero();
    }  // else the steps go on: they may be the only dither, or no slope may ever show
    clip_each(out, rate);
  } else {
    good_ = estimate;
    has_good_ = true;
  }
  for (int pass = 0; pass < 4; ++pass) {
    bool changed = false;
    for (std::size_t i = 0; i < limits_.size(); ++i) {
      const double allowed = std::max(0.0, excess(i, estimate, reach));
      const double over = excess(i, estimate + out, reach) - allowed;
      const Inputs s = models_[i].slope();
      if (silent(i, allowed)) continue;
      if (!(over > 1e-12 * limits_[i].scale) || !(s.squaredNorm() > 0.0)) continue;
      out -= s * (over / s.squaredNorm());
      changed = active_ = true;
    }
    if (!changed) break;
  }
  // What projections in turns leave over: a shorter step in the same direction keeps every rate and every limit.
  const Inputs cap = rate.cwiseMax(step.cwiseAbs());
  double share = 1.0;
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    if (std::abs(out[i]) > cap[i]) share = std::min(share, cap[i] / std::abs(out[i]));
  }
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    const double rise = models_[i].slope().dot(out);
    const double room = std::max(0.0, -excess(i, estimate, reach));
    if (silent(i, excess(i, estimate, reach))) continue;
    if (rise > room + 1e-12 * limits_[i].scale) share = std::min(share, room / rise);
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
  std::fill(in_a_row_.begin(), in_a_row_.end(), 0.0);
  has_good_ = false;
  active_ = false;
}

}  // namespace mgdd::optimize
