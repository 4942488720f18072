#include "mgdd/optimize/watch/first_readings.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/watch/outliers.hpp"

namespace mgdd::optimize {
namespace {

constexpr int rounds = 6;
constexpr double standard_errors = 1.5;
constexpr double farthest = 20.0;     // where the optimum is at most, in reaches
constexpr double least_moved = 0.25;  // of the reach: with less applied neither slope nor bend is computed
constexpr double least_of_all = 1e-3;
constexpr double least_movement = 1e-13;  // of J
constexpr double lags = 3.0;              // after which a first-order lag has settled
constexpr double far_quartiles = 4.0;  // upper quartiles of the distances from the median: 4.2 sd of a normal scatter

// Whole cycles by which every component is late.
std::int64_t delay_of(const std::vector<ComponentLag>& components) {
  double shortest = components.empty() ? 0.0 : components[0].delay_cycles;
  for (const ComponentLag& c : components)
    shortest = std::min(shortest, c.delay_cycles);
  return static_cast<std::int64_t>(shortest);
}

// Cycles after these until all of them have settled.
std::int64_t settling_cycles(const std::vector<ComponentLag>& components) {
  double longest = 0.0;
  for (const ComponentLag& c : components)
    longest = std::max(longest, c.delay_cycles + lags * c.lag_cycles);
  return 1 + static_cast<std::int64_t>(std::ceil(longest)) - delay_of(components);
}

}  // namespace

FirstReadings::FirstReadings(Inputs reach, double share, bool wanted, std::optional<double> curvature,
                             const std::vector<ComponentLag>& components)
    : reach_(std::move(reach)),
      share_(share),
      delay_(delay_of(components)),
      settle_(settling_cycles(components)),
      open_(wanted && !(curvature && *curvature != 0.0)),
      bend_(Inputs::Constant(reach_.size(), curvature ? std::abs(*curvature) : 0.0)),
      asked_(bend_) {
  if (!open_) return;
  readings_.assign(static_cast<std::size_t>(rounds * slots()), 0.0);
  applied_.assign(static_cast<std::size_t>(slots()), 0.0);
  scratch_ = readings_;
}

const Inputs& FirstReadings::ask(const Inputs& estimate) noexcept {
  asked_ = estimate;
  const Eigen::Index slot = told_ / settle_ % slots();
  if (slot % 2 == 1 && told_ < cycles()) asked_[slot / 4] += slot % 4 == 1 ? reach_[slot / 4] : -reach_[slot / 4];
  return asked_;
}

void FirstReadings::learn(const Inputs& applied, double j) noexcept {
  if ((told_ + 1) % settle_ == 0 && told_ < cycles()) {
    const Eigen::Index slot = told_ / settle_ % slots();
    applied_[static_cast<std::size_t>(slot)] += applied[slot / 4];
  }
  const std::int64_t read = told_ - delay_;
  if (read >= 0 && (read + 1) % settle_ == 0) readings_[static_cast<std::size_t>(read / settle_)] = j;
  if (++told_ == cycles() + delay_) close();
}

void FirstReadings::skip(const Inputs& applied) noexcept {
  if (delay_ > 0) learn(applied, unread);
}

// The mean of the same point in place of what was not read; false where a point was never read.
bool FirstReadings::fill() noexcept {
  Eigen::Map<Eigen::MatrixXd> y(readings_.data(), slots(), rounds);
  for (Eigen::Index s = 0; s < slots(); ++s) {
    const Eigen::Array<bool, 1, Eigen::Dynamic, Eigen::RowMajor, 1, rounds> read = y.row(s).array() != unread;
    if (!read.any()) return false;
    const double mean = read.select(y.row(s).array(), 0.0).sum() / static_cast<double>(read.count());
    y.row(s) = read.select(y.row(s).array(), mean);
  }
  return true;
}

// What lies far out of the readings of the same point counts as their median. No perturbation is in these: up to a
// quarter of all may be out. Of a J on coarse steps, most of whose distances are 0, what three have in common stays.
void FirstReadings::bring_in() noexcept {
  Eigen::Map<Eigen::MatrixXd> y(readings_.data(), slots(), rounds);
  Eigen::MatrixXd::Index out = 0;
  const auto middle = [&](Eigen::Index s) {
    std::array<double, rounds> row{};
    for (Eigen::Index r = 0; r < rounds; ++r)
      row[static_cast<std::size_t>(r)] = y(s, r);
    return median_of(row);
  };
  for (Eigen::Index s = 0; s < slots(); ++s) {
    const double of_point = middle(s);
    for (Eigen::Index r = 0; r < rounds; ++r)
      scratch_[static_cast<std::size_t>(out++)] = std::abs(y(s, r) - of_point);
  }
  const auto quartile = scratch_.begin() + static_cast<std::ptrdiff_t>(3 * scratch_.size() / 4);
  std::nth_element(scratch_.begin(), quartile, scratch_.end());
  const double farthest = *quartile > 0.0 ? far_quartiles * *quartile : farthest_of(scratch_);
  for (Eigen::Index s = 0; s < slots(); ++s) {
    const double of_point = middle(s);
    y.row(s) = ((y.row(s).array() - of_point).abs() > farthest).select(of_point, y.row(s).array());
  }
}

void FirstReadings::close() noexcept {
  told_ = 0;
  if (!fill()) return restart();
  bring_in();
  Eigen::Map<Eigen::MatrixXd> y(readings_.data(), slots(), rounds);
  const double highest = y.cwiseAbs().maxCoeff();
  // A steady drift of the level is neither a bend nor noise.
  constexpr int half = rounds / 2;
  const auto all = static_cast<double>(y.size());
  const double drift = (y.rightCols<half>().sum() - y.leftCols<half>().sum()) / (0.25 * all * all);
  double start = 0.0, squares = 0.0;
  for (Eigen::Index k = 0; k < y.size(); ++k) {
    y(k) -= drift * static_cast<double>(k);
    if (k % 2 == 0) start += y(k) / (0.5 * all);
  }
  for (Eigen::Index s = 0; s < slots(); ++s)
    squares += (y.row(s).array() - (s % 2 == 0 ? start : y.row(s).mean())).square().sum();
  const double means = 2.0 + 0.5 * static_cast<double>(slots());  // taken off: start, drift, two per input
  const double noise = std::sqrt(squares / (all - means));
  const double bend_error = std::sqrt((2.0 + 2.0 / static_cast<double>(reach_.size())) / rounds) * noise;
  for (Eigen::Index i = 0; i < reach_.size(); ++i) {
    const double c = reach_[i];
    const double* const x = &applied_[static_cast<std::size_t>(4 * i)];
    const double middle = 0.5 * (x[0] + x[2]), up = (x[1] - middle) / rounds, down = (middle - x[3]) / rounds;
    double slope = 0.0, seen = 0.0;
    if (std::min(up, down) > least_moved * c) {
      const double rise = (y.row(4 * i + 1).mean() - start) / up, fall = (start - y.row(4 * i + 3).mean()) / down;
      slope = (rise * down + fall * up) / (up + down);
      seen = std::abs(2.0 * (rise - fall) / (up + down)) - standard_errors * bend_error / (up * down);
    }
    bend_[i] = std::max({share_ * noise / (c * c), seen, std::abs(slope) / (farthest * c)});
  }
  const double largest = bend_.cwiseProduct(reach_.cwiseAbs2()).maxCoeff();
  if (!(largest > least_movement * highest)) return restart();  // J has not moved at all: nothing to go by
  bend_ = bend_.cwiseMax(least_of_all * largest * reach_.cwiseAbs2().cwiseInverse());
  open_ = false;
}

void FirstReadings::restart() noexcept {
  if (!open_) return;
  told_ = 0;
  std::fill(applied_.begin(), applied_.end(), 0.0);
}

void FirstReadings::require_usable() const {
  if (open_ && !(told_ < cycles() + delay_)) {
    throw ParameterError("state column 'first_open' holds 1: must be 0, as these settings give the gain");
  }
  if (!open_ && !readings_.empty() && !((bend_.array() > 0.0).all() && bend_.allFinite())) {
    throw ParameterError("state column 'first_bend' must hold finite numbers > 0: the gain is made of them");
  }
}

}  // namespace mgdd::optimize
