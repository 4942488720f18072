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

}  // namespace

// By what quantiles of few readings exceed normal ones.
double GaussianProcessSeeking::student(const ProcessModel& model) const noexcept {
  return 1.0 + few_readings / std::max(1.0, static_cast<double>(model.count() - estimate_.size()));
}

// What limit i would be exceeded by at a point of the last prediction, that many standard deviations above the mean.
double GaussianProcessSeeking::excess(std::size_t i, int point, double quantile) const noexcept {
  const Limit& limit = settings_.limits[i];
  const ProcessModel& model = limited_[i];
  const double sd = std::sqrt(std::max(model.covariance(point, point), 0.0));
  return model.mean(point) + quantile * student(model) * sd + limit.margin + limit.margin_sd * model.noise_sd() -
         limit.upper;
}

void GaussianProcessSeeking::judge(double likely, double mean, int point) noexcept {
  const auto at = static_cast<std::size_t>(point);
  over_[at] = std::max(over_[at], likely);
  mean_over_[at] = std::max(mean_over_[at], mean);
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

// Largest excess of any limit, in scales, of every candidate: with the stated probability, and in the mean.
void GaussianProcessSeeking::judge_safety(int points) noexcept {
  std::fill(over_.begin(), over_.end(), -largest_reading);
  std::fill(mean_over_.begin(), mean_over_.end(), -largest_reading);
  if (failures_known()) judge_failures(points);
  for (std::size_t i = 0; i < limited_.size(); ++i) {
    limited_[i].predict(candidates_, points);
    const double scale = settings_.limits[i].scale;
    for (int p = 0; p < points; ++p)
      judge(excess(i, p, quantile_) / scale, excess(i, p, 0.0) / scale, p);
  }
}

}  // namespace mgdd::optimize
