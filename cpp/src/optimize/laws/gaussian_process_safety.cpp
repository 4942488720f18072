// Where a seeker by Gaussian processes may ask: inside its limits, and where cycles work; and the best input there.
#include <algorithm>
#include <cmath>

#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
namespace {

constexpr FailingProcess::Demand not_failing{2.0, 0.0, 0.8}, wary_of_failing{2.0, -0.5, 0.5};  // the latter after one

constexpr double rise_of_limit = 1.2;  // scales per range: sd of its slope before readings, 0.4 of 3 bends
constexpr double rises_in_room = 2.0, least_step = 0.25;  // sd that a first step leaves room for; of the whole step

constexpr int search_points = 12;  // of the cloud that the search for the best begins with
constexpr double search_width = 0.08;

constexpr int pull_rounds = 2, pull_sweeps = 4;  // the process bends, and limits meet
constexpr double farthest_pull = 0.3;            // in ranges, as far as slopes at the estimate may say
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
void GaussianProcessSeeking::judge_safety(int points, double quantile, const FailingProcess::Demand& works) noexcept {
  std::fill(over_.begin(), over_.end(), -largest_reading);
  std::fill(mean_over_.begin(), mean_over_.end(), -largest_reading);
  std::fill(credit_.begin(), credit_.end(), 0.0);
  if (failing_.by_input()) {
    failing_.predict(candidates_, points);
    failing_.judge(points, 0, works, [this](double likely, double mean, int p) { judge(likely, mean, p); });
  }
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    limited_[i].model().predict(candidates_, points);
    for (int p = 0; p < points; ++p) {
      const auto at = static_cast<std::size_t>(p);
      const double likely = limited_[i].excess(p, quantile), mean = limited_[i].excess(p, 0.0);
      excess_(static_cast<Eigen::Index>(i), p) = likely;
      credit_[at] += multipliers_[i] * (likely - mean);
      judge(likely, mean, p);
    }
  }
}

// The same, with candidates that break a limit moved back to its edge: in a corner of limits few draws lie inside.
void GaussianProcessSeeking::keep_safe(int points) noexcept {
  const FailingProcess::Demand& works = since_failure_ < wary_ ? wary_of_failing : not_failing;
  for (int round = 0; round < pull_rounds; ++round) {
    judge_safety(points, cautious_quantile_, works);
    if (!pull_back(points)) return;
  }
  judge_safety(points, cautious_quantile_, works);
}

// Along the slopes at the estimate, by projections in turn (Kaczmarz 1937).
bool GaussianProcessSeeking::pull_back(int points) noexcept {
  bool moved = false;
  for (int p = 1; p < points; ++p) {
    Inputs step = Inputs::Zero(estimate_.size());
    for (int sweep = 0; sweep < pull_sweeps; ++sweep) {
      for (std::size_t i = 0; i < limited_.size(); ++i) {
        const auto edge = edges_.row(static_cast<Eigen::Index>(i));
        const double off = excess_(static_cast<Eigen::Index>(i), p) + edge.dot(step) + inside_edge;
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

// The best input around a point that keeps the limits: of a cloud there, then uphill along them. Where none does, the
// one that breaks them least.
Inputs GaussianProcessSeeking::best_of_mean(const Inputs& from) noexcept {
  const Eigen::Index n = from.size(), limits = edges_.rows();
  const auto take = [&](int points) {
    candidates_.row(points) = good_.transpose();  // what may fail is judged beside what worked
    judge_safety(points + 1, quantile_, not_failing);
    for (ProcessModel& model : j_)
      model.predict_means(candidates_, points);
  };
  const auto at = [&](int p) { return Climb::Worth{over_[static_cast<std::size_t>(p)], mean(p)}; };
  const auto consider = [&](int points) {
    for (int p = 0; p < points; ++p)
      climb_.consider(candidates_.row(p).transpose(), at(p));
  };
  const auto over_at = [&](int p) {
    for (Eigen::Index i = 0; i < limits; ++i)
      edge_over_[static_cast<std::size_t>(i)] = excess_(i, p) + Climb::inside;
    return std::span(edge_over_);
  };
  candidates_.row(0) = reachable(from).transpose();
  for (int p = 1; p <= search_points; ++p) {
    Inputs z = from;
    for (Eigen::Index i = 0; i < n; ++i)
      z[i] += search_width * draw(200, p * max_inputs + static_cast<int>(i));
    candidates_.row(p) = reachable(z).transpose();
  }
  take(search_points + 1);
  climb_.begin(candidates_.row(0).transpose(), at(0));
  consider(search_points + 1);
  for (int round = 0; round < Climb::rounds; ++round) {
    const int star = climb_.star();
    for (int p = 0; p < star; ++p)
      candidates_.row(p) = climb_.beside(p, aside_).transpose();
    take(star);
    for (Eigen::Index i = 0; i < limits; ++i)
      climb_.slopes(aside_, [&](int k) { return excess_(i, k); }, edges_.row(i));
    climb_.renew(at(0));
    climb_.aim(aside_, [&](int k) { return mean(k); }, edges_, over_at(0), nearest_);
    for (std::size_t i = 0; i < limited_.size(); ++i)
      multipliers_[i] = nearest_.multiplier(i);
    for (int p = 1; protocol_.steps.any() && p < star; ++p) {
      const Inputs z = candidates_.row(p).transpose();
      if (reachable(z) == z) climb_.consider(z, at(p));
    }
    for (const bool back : {false, true}) {
      for (int k = 0; k < Climb::tries; ++k) {
        const Inputs z = back ? climb_.moved_back(k, edges_, over_at(k), nearest_) : climb_.tried(k);
        candidates_.row(k) = reachable(z).transpose();
      }
      take(Climb::tries);
      consider(Climb::tries);
      if (limits == 0) break;
    }
    climb_.narrow();
  }
  return climb_.best();
}

}  // namespace mgdd::optimize
