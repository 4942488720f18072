#include "mgdd/guide/limit_curves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace mgdd::guide {
namespace {

using optimize::LimitState;

constexpr double level_share = 0.1;   // of the limit's scale: how far a guide's curve may lie off
constexpr double slope_sd = 0.3;      // [-] of the plant's slope over the guide's
constexpr double noise_share = 0.01;  // of the limit's scale: first guess of the noise
constexpr double limit_guess_counts = 4.0;
constexpr double caution = 2.0;  // standard deviations of the mean
constexpr int grid = 160, halvings = 10;

double scale_of(const optimize::Limit& limit) noexcept {
  if (limit.scale > 0.0) return limit.scale;
  return limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
}

}  // namespace

LimitCurves::LimitCurves(std::vector<optimize::Limit> limits, std::vector<Curve> curves, double lower, double upper,
                         double reach, double memory_cycles, double step)
    : limits_(std::move(limits)),
      curves_(std::move(curves)),
      causes_(optimize::lags_of(limits_, memory_cycles), 1),
      lower_(lower),
      upper_(upper),
      reach_(reach),
      step_(curves_.empty() ? step : 0.0),
      fading_(std::exp(-1.0 / memory_cycles)),
      sums_(limits_.size()),
      states_(limits_.size(), 0.0) {
  if (limits_.size() > max_limits) {
    throw about("limits", ShapeError("limits has " + std::to_string(limits_.size()) + " entries: at most 8 here"));
  }
  if (!curves_.empty() && curves_.size() != limits_.size()) {
    throw about("limit_curves",
                ShapeError("limit_curves has " + std::to_string(curves_.size()) +
                           " entries: must have one per limit, " + std::to_string(limits_.size()) + ", or none"));
  }
  for (optimize::Limit& limit : limits_)
    limit.scale = scale_of(limit);
  for (std::size_t i = 0; i < curves_.size(); ++i)
    prefixes_.push_back("limit_curve" + std::to_string(i) + ".");
}

double LimitCurves::shape(std::size_t i, double input) const noexcept {
  return curves_.empty() ? input : curves_[i](input);
}

void LimitCurves::record(double applied, std::span<const double> values) noexcept {
  if (limits_.empty()) return;
  const optimize::Inputs now = optimize::scalar_input(applied);
  causes_.record(now);
  last_ = applied;
  for (std::size_t i = 0; i < limits_.size(); ++i) {
    if (!causes_.known(i)) continue;
    auto& n = sums_[i];
    if (causes_.judge(i, now, values[i])) n.fill(0.0);
    const double x = shape(i, causes_.of(i, now)[0]), y = values[i];
    // Running means: sums of squares of large numbers would cancel.
    n[count] = fading_ * n[count] + 1.0;
    const double share = 1.0 / n[count], dx = x - n[mean_m], dy = y - n[mean_y];
    n[mm] = (1.0 - share) * (n[mm] + share * dx * dx);
    n[my] = (1.0 - share) * (n[my] + share * dx * dy);
    n[yy] = (1.0 - share) * (n[yy] + share * dy * dy);
    n[mean_m] += share * dx;
    n[mean_y] += share * dy;
  }
}

void LimitCurves::restart(std::span<const Curve> curves) noexcept {
  for (auto& of_limit : sums_)
    of_limit.fill(0.0);
  std::fill(states_.begin(), states_.end(), 0.0);
  causes_.forget();
  if (curves.size() == curves_.size()) std::copy(curves.begin(), curves.end(), curves_.begin());
}

// Normal a about the curve's own level, normal b about one (about nothing for a straight line); the noise is plugged
// in.
LimitCurves::Line LimitCurves::line(std::size_t i) const noexcept {
  const auto& n = sums_[i];
  const double scale = limits_[i].scale;
  const bool drawn = !curves_.empty();
  const double var_a = drawn ? std::pow(level_share * scale, 2) : std::numeric_limits<double>::infinity();
  const double var_b = drawn ? slope_sd * slope_sd : std::pow(scale / reach_, 2);
  const double slope = drawn ? 1.0 : 0.0;
  const double guess = std::pow(noise_share * scale, 2);
  Line out{n[mean_m], n[mean_m], slope, var_a, var_b, guess};
  if (!(n[count] > 0.0)) return out;
  for (int pass = 0; pass < 3; ++pass) {
    const double information = n[count] * n[mm] / out.noise + 1.0 / var_b;
    out.b = (n[count] * n[my] / out.noise + slope / var_b) / information;
    out.var_b = 1.0 / information;
    const double left = n[count] * std::max(0.0, n[yy] - 2.0 * out.b * n[my] + out.b * out.b * n[mm]);
    out.noise = (limit_guess_counts * guess + left) / (limit_guess_counts + std::max(0.0, n[count] - 2.0));
  }
  const double level = n[count] / out.noise + 1.0 / var_a;
  out.a = (n[count] * n[mean_y] / out.noise + (drawn ? n[mean_m] / var_a : 0.0)) / level;
  out.var_a = 1.0 / level;
  return out;
}

double LimitCurves::scaled_excess(std::size_t i, double input, const Line& line) const noexcept {
  const optimize::Limit& limit = limits_[i];
  const double x = shape(i, input);
  if (!(sums_[i][count] > 0.0)) {
    if (curves_.empty()) return -std::numeric_limits<double>::infinity();
    return (x + caution * std::sqrt(line.var_a) + limit.margin - limit.upper) / limit.scale;
  }
  const double away = x - line.centre;
  const double sd = std::hypot(std::sqrt(line.var_a), std::sqrt(line.var_b) * std::max(0.0, std::abs(away) - step_));
  const double margin = limit.margin + limit.margin_sd * std::sqrt(line.noise);
  return (line.a + line.b * away + caution * sd + margin - limit.upper) / limit.scale;
}

double LimitCurves::excess(double input) const noexcept {
  double worst = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < limits_.size(); ++i)
    worst = std::max(worst, scaled_excess(i, input, line(i)));
  return worst;
}

bool LimitCurves::blind() const noexcept {
  if (!curves_.empty()) return false;
  return std::any_of(sums_.begin(), sums_.end(), [](const auto& n) { return !(n[count] > 0.0); });
}

double LimitCurves::nearest(double wanted) noexcept {
  if (limits_.empty()) return wanted;
  if (blind()) return last_.value_or(wanted);  // nothing is known of a limit yet: stay
  std::array<Line, max_limits> lines{};
  for (std::size_t i = 0; i < limits_.size(); ++i)
    lines[i] = line(i);
  const auto worst = [&](double input) {
    double most = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < limits_.size(); ++i)
      most = std::max(most, scaled_excess(i, input, lines[i]));
    return most;
  };
  for (std::size_t i = 0; i < limits_.size(); ++i)
    states_[i] = static_cast<double>(scaled_excess(i, wanted, lines[i]) > 0.0 ? LimitState::active : LimitState::free);
  if (worst(wanted) <= 0.0) return wanted;
  double best = wanted, least = std::numeric_limits<double>::infinity(), lowest = wanted;
  bool found = false;
  for (int k = 0; k <= grid; ++k) {
    const double x = lower_ + (upper_ - lower_) * k / grid;
    const double over = worst(x);
    if (over <= 0.0 && (!found || std::abs(x - wanted) < std::abs(best - wanted))) {
      best = x;
      found = true;
    }
    if (over < least) {
      least = over;
      lowest = x;
    }
  }
  if (!found) {
    for (std::size_t i = 0; i < limits_.size(); ++i) {
      if (scaled_excess(i, lowest, lines[i]) > 0.0) states_[i] = static_cast<double>(LimitState::infeasible);
    }
    return lowest;
  }
  double outside = best + std::copysign(std::min(std::abs(wanted - best), (upper_ - lower_) / grid), wanted - best);
  for (int k = 0; k < halvings; ++k) {
    const double middle = 0.5 * (best + outside);
    (worst(middle) <= 0.0 ? best : outside) = middle;
  }
  return best;
}

LimitState LimitCurves::state(std::size_t i) const noexcept {
  return static_cast<LimitState>(states_[i]);
}

}  // namespace mgdd::guide
