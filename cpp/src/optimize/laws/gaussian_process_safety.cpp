// Where a seeker by Gaussian processes may ask: inside its limits, and where cycles work.
#include <algorithm>
#include <cmath>

#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
namespace {

constexpr FailingProcess::Demand not_failing{2.0, 0.0, 0.8}, wary_of_failing{2.0, -0.5, 0.5};  // the latter after one

constexpr double rise_of_limit = 1.2;  // scales per range: sd of its slope before readings, 0.4 of 3 bends
constexpr double rises_in_room = 2.0, least_step = 0.25;  // sd that a first step leaves room for; of the whole step

constexpr int pull_rounds = 2, pull_sweeps = 4;  // the process bends, and limits meet
constexpr double farthest_pull = 0.3;            // in ranges, as far as slopes at the estimate may say
constexpr double at_bound = 1e-3;                // ranges
constexpr double inside_edge = 1e-3;             // scales of a limit, so that rounding leaves it kept

}  // namespace

// The first step, shorter where the readings so far leave a limit little room; half of it before any reading.
double GaussianProcessSeeking::side_step() const noexcept {
  const double whole = rises_in_room * rise_of_limit * settings_.first_step;
  double room = limited_.empty() ? whole : unlimited;
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    room = std::min(room, limited_[i].model().count() > 0 ? limited_[i].room() : 0.5 * whole);
  }
  return settings_.first_step * std::clamp(room / whole, least_step, 1.0);
}

void GaussianProcessSeeking::judge(double likely, double mean, int point) noexcept {
  const auto at = static_cast<std::size_t>(point);
  over_[at] = std::max(over_[at], likely);
  mean_over_[at] = std::max(mean_over_[at], mean);
}

// Largest excess of any limit, in scales, of every candidate: that many standard deviations above the mean, and in it.
void GaussianProcessSeeking::judge_safety(int points, double quantile) noexcept {
  std::fill(over_.begin(), over_.end(), -largest_reading);
  std::fill(mean_over_.begin(), mean_over_.end(), -largest_reading);
  std::fill(credit_.begin(), credit_.end(), 0.0);
  if (failing_.by_input()) {
    failing_.predict(candidates_, points);
    failing_.judge(points, 0, since_failure_ < wary_ ? wary_of_failing : not_failing,
                   [this](double likely, double mean, int p) { judge(likely, mean, p); });
  }
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    limited_[i].model().predict(candidates_, points);
    for (int p = 0; p < points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const double likely = limited_[i].excess(p, quantile), mean = limited_[i].excess(p, 0.0);
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
        if (off > inside_edge * 0.5 && steep > 0.0) step -= off / steep * edge.transpose();
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

// Slopes of the limits at a point, and what J would gain there by each that holds it back, were it wider.
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
  Inputs low = Inputs::Constant(n, -unlimited), high = -low;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (at[k] < at_bound) low[k] = 0.0;
    if (at[k] > 1.0 - at_bound) high[k] = 0.0;
  }
  nearest_.begin(rest, InputMatrix::Identity(n, n), low, high);
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    auto edge = edges_.row(static_cast<Eigen::Index>(i));
    slopes(limited_[i].model(), edge, settings_.limits[i].scale);
    edge = pointing(edge.transpose()).transpose();
    nearest_.add(edge.transpose(), excess_[i * candidates] > -active_room ? 0.0 : unlimited);
  }
  nearest_.solve(0.0);
  for (std::size_t i = 0; i < limited_.size(); ++i)
    multipliers_[i] = nearest_.multiplier(i);
}

}  // namespace mgdd::optimize
