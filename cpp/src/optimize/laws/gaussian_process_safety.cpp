// Where a seeker by Gaussian processes may ask: inside its limits, and where cycles work.
#include <algorithm>
#include <cmath>

#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"

namespace mgdd::optimize {
namespace {

constexpr double few_readings = 2.0;      // over degrees of freedom
constexpr double failing_quantile = 2.0;  // of the label of a cycle, -1 where it works, 1 where it fails
constexpr double most_failing = 0.0, wary_failing = -0.5;  // quantile that is asked for, and after a failure
constexpr double failing_room = 0.8, wary_room = 0.5;      // by which it may exceed the least one

constexpr double surest = 0.02;                         // probability: the process of labels promises too much
constexpr double usual_rate = 0.1, rate_memory = 0.99;  // of cycles that fail anywhere, before any was seen

constexpr double rise_of_limit = 1.2;  // scales per range: sd of its slope before readings, 0.4 of 3 bends
constexpr double rises_in_room = 2.0, least_step = 0.25;  // sd that a first step leaves room for; of the whole step

constexpr int pull_rounds = 2, pull_sweeps = 4;       // the process bends, and limits meet
constexpr double farthest_pull = 0.3;                 // in ranges, as far as slopes at the estimate may say
constexpr double inside_edge = 1e-3;                  // scales of a limit, so that rounding leaves it kept
constexpr double least_slope = 1e-3;                  // scales of a limit per range: flatter ones point nowhere
constexpr double slope_step = 0.01, at_bound = 1e-3;  // ranges
constexpr int multiplier_sweeps = 60;

}  // namespace

// The first step, shorter where the readings so far leave a limit little room; half of it before any reading.
double GaussianProcessSeeking::side_step() const noexcept {
  const double whole = rises_in_room * rise_of_limit * settings_.first_step;
  double room = limited_.empty() ? whole : unlimited;
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    const Limit& limit = settings_.limits[i];
    const double known = (limit.upper - limit.margin - limited_[i].highest()) / limit.scale;
    room = std::min(room, limited_[i].count() > 0 ? known : 0.5 * whole);
  }
  return settings_.first_step * std::clamp(room / whole, least_step, 1.0);
}

// By what quantiles of few readings exceed normal ones.
double GaussianProcessSeeking::student(const ProcessModel& model) const noexcept {
  return 1.0 + few_readings / std::max(1.0, static_cast<double>(model.count() - estimate_.size()));
}

// What limit i would be exceeded by at a point of the last prediction, that many standard deviations above the mean.
double GaussianProcessSeeking::excess(std::size_t i, int point, double quantile) const noexcept {
  const Limit& limit = settings_.limits[i];
  const ProcessModel& model = limited_[i];
  const double sd = std::sqrt(std::max(model.covariance(point, point), 0.0));
  return model.mean(point) + quantile * student(model) * sd + limit.margin - limit.upper;
}

void GaussianProcessSeeking::judge(double likely, double mean, int point) noexcept {
  const auto at = static_cast<std::size_t>(point);
  over_[at] = std::max(over_[at], likely);
  mean_over_[at] = std::max(mean_over_[at], mean);
}

// Whether cycles fail by their input or anywhere, by how well either foretold this one.
void GaussianProcessSeeking::watch_failures(const Inputs& z, bool worked) noexcept {
  if (failures_known()) {
    candidates_.row(0) = z.transpose();
    failing_.predict_means(candidates_, 1);
    const double here = std::clamp(0.5 * (1.0 + failing_.mean(0)), surest, 1.0 - surest);
    const double rate = (failed_ + 1.0) / (seen_ + 1.0 / usual_rate);
    anywhere_ += std::log(worked ? (1.0 - rate) / (1.0 - here) : rate / here);
    anywhere_ = std::clamp(anywhere_, least_anywhere, -least_anywhere);
  }
  seen_ = rate_memory * seen_ + 1.0;
  failed_ = rate_memory * failed_ + (worked ? 0.0 : 1.0);
}

// A candidate that may fail is out of the question, unless all of them may: as where cycles fail at random.
void GaussianProcessSeeking::judge_failures(int points) noexcept {
  failing_.predict(candidates_, points);
  double least = largest_reading;
  const auto likely = [&](int p) {
    return failing_.mean(p) + failing_quantile * std::sqrt(std::max(failing_.covariance(p, p), 0.0));
  };
  for (int p = 0; p < points; ++p)
    least = std::min(least, likely(p));
  const bool wary = since_failure_ < wary_;
  const double most = std::max(wary ? wary_failing : most_failing, least + (wary ? wary_room : failing_room));
  for (int p = 0; p < points; ++p)
    judge(likely(p) - most, failing_.mean(p), p);
}

// Largest excess of any limit, in scales, of every candidate: that many standard deviations above the mean, and in it.
void GaussianProcessSeeking::judge_safety(int points, double quantile) noexcept {
  std::fill(over_.begin(), over_.end(), -largest_reading);
  std::fill(mean_over_.begin(), mean_over_.end(), -largest_reading);
  std::fill(credit_.begin(), credit_.end(), 0.0);
  if (failures_known() && anywhere_ <= 0.0) judge_failures(points);
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    limited_[i].predict(candidates_, points);
    const double scale = settings_.limits[i].scale;
    for (int p = 0; p < points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const double likely = excess(i, p, quantile) / scale, mean = excess(i, p, 0.0) / scale;
      excess_[i * candidates + at] = likely;
      credit_[at] += multipliers_[i] * (likely - mean);
      judge(likely, mean, p);
    }
  }
}

// The same, with candidates that break a limit moved back to its edge: in a corner of limits few draws lie inside.
void GaussianProcessSeeking::keep_safe(int points, double quantile) noexcept {
  for (int round = 0; round < pull_rounds; ++round) {
    judge_safety(points, quantile);
    if (!pull_back(points)) return;
  }
  judge_safety(points, quantile);
}

// Along the slopes at the estimate, by projections in turn (Kaczmarz 1937).
bool GaussianProcessSeeking::pull_back(int points) noexcept {
  bool moved = false;
  for (int p = 1; p < points; ++p) {
    Inputs step = Inputs::Zero(estimate_.size());
    for (int sweep = 0; sweep < pull_sweeps; ++sweep) {
      for (std::size_t i = 0; i < limited_.size(); ++i) {
        const auto edge = edges_.row(static_cast<Eigen::Index>(i));
        const double off = excess_[i * candidates + static_cast<std::size_t>(p)] + edge.dot(step) + inside_edge;
        const double steep = edge.squaredNorm();
        if (off > inside_edge * 0.5 && steep > least_slope * least_slope) step -= off / steep * edge.transpose();
      }
    }
    const double far = step.norm();
    if (far == 0.0) continue;
    moved = true;
    step *= std::min(1.0, farthest_pull / far);
    candidates_.row(p) = reachable(candidates_.row(p).transpose() + step).transpose();
  }
  return moved;
}

// Slopes of the limits at a point, and what J would gain there by each that holds it back, were it wider: the
// multipliers of Lagrange, by non-negative least squares in turns.
void GaussianProcessSeeking::know_edge(const Inputs& at) noexcept {
  if (limited_.empty()) return;
  const Eigen::Index n = at.size();
  const int points = 1 + 2 * static_cast<int>(n);
  candidates_.topRows(points) = at.transpose().replicate(points, 1);
  Inputs apart(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    candidates_(1 + 2 * k, k) = std::min(1.0, at[k] + slope_step);
    candidates_(2 + 2 * k, k) = std::max(0.0, at[k] - slope_step);
    apart[k] = candidates_(1 + 2 * k, k) - candidates_(2 + 2 * k, k);
  }
  const auto slopes = [&](const ProcessModel& model, auto&& out, double scale) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const int up = 1 + 2 * static_cast<int>(k);
      out[k] += (model.mean(up) - model.mean(up + 1)) / (apart[k] * scale);
    }
  };
  Inputs rest = Inputs::Zero(n);
  for (ProcessModel& model : j_) {
    model.predict_means(candidates_, points);
    slopes(model, rest, 1.0);
  }
  std::fill(multipliers_.begin(), multipliers_.end(), 0.0);
  edges_.setZero();
  judge_safety(points, quantile_);
  for (std::size_t i = 0; i < limited_.size(); ++i)
    slopes(limited_[i], edges_.row(static_cast<Eigen::Index>(i)), settings_.limits[i].scale);
  Inputs held = Inputs::Zero(n);  // by bounds
  const auto more = [](double& multiplier, double by) {
    const double was = multiplier;
    multiplier = std::max(0.0, was + by);
    return multiplier - was;
  };
  for (int sweep = 0; sweep < multiplier_sweeps; ++sweep) {
    for (std::size_t i = 0; i < limited_.size(); ++i) {
      const auto edge = edges_.row(static_cast<Eigen::Index>(i));
      const double steep = edge.squaredNorm();
      if (excess_[i * candidates] <= -active_room || !(steep > least_slope * least_slope)) continue;
      rest -= more(multipliers_[i], edge.dot(rest) / steep) * edge.transpose();
    }
    for (Eigen::Index k = 0; k < n; ++k) {
      const double side = at[k] < at_bound ? -1.0 : at[k] > 1.0 - at_bound ? 1.0 : 0.0;
      if (side != 0.0) rest[k] -= side * more(held[k], side * rest[k]);
    }
  }
}

}  // namespace mgdd::optimize
