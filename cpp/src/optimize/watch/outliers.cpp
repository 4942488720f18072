#include "mgdd/optimize/watch/outliers.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/optimize/ask_tell/reading.hpp"

namespace mgdd::optimize {
namespace {

constexpr std::int64_t fewest = 12, room_of_one = 24, room_per_input = 6;  // a strong input among weak ones thrice
constexpr std::size_t ordinary = 3;                                        // from the top: the first that counts
constexpr double beyond = 3.0;                                             // 4.6 sd of a normal scatter
constexpr double spoiling = 10.0;  // times that: a first reading that bends what was made of it

}  // namespace

double median_of(std::span<double> values) noexcept {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double farthest_of(std::span<double> distances) noexcept {
  if (distances.size() < ordinary) return unlimited;
  const auto at = distances.end() - static_cast<std::ptrdiff_t>(ordinary);
  std::nth_element(distances.begin(), at, distances.end());
  return beyond * *at;
}

Outliers::Outliers(std::size_t components, const std::vector<Limit>& limits, Eigen::Index inputs)
    : components_(components),
      room_(room_of_one + room_per_input * (inputs - 1)),
      ring_((components + limits.size()) * static_cast<std::size_t>(room_), 0.0),
      low_(components + limits.size(), -largest_reading),
      high_(low_.size(), largest_reading),
      scratch_(static_cast<std::size_t>(room_), 0.0),
      admitted_(low_.size(), 0.0) {
  for (const Limit& limit : limits)
    uppers_.push_back(limit.upper);
}

// What this channel may lie between, by the readings that are known.
void Outliers::bound(std::size_t channel) noexcept {
  const auto n = static_cast<std::size_t>(known_);
  const double* const ring = &ring_[channel * static_cast<std::size_t>(room_)];
  const std::span<double> scratch(scratch_.data(), n);
  std::copy(ring, ring + n, scratch.begin());
  const double middle = median_of(scratch);
  std::transform(ring, ring + n, scratch.begin(), [&](double value) { return std::abs(value - middle); });
  double farthest = farthest_of(scratch);
  if (!(farthest > 0.0)) farthest = 2.0 * largest_reading;  // what stands still shows no scatter
  low_[channel] = middle - farthest;
  high_[channel] = middle + farthest;
  if (count_ > fewest) return;
  bool& spoiled = channel < components_ ? spoiled_ : limits_spoiled_;
  for (const double distance : scratch)
    spoiled = spoiled || distance > spoiling * farthest;
}

std::span<const double> Outliers::admit(std::span<const double> components, std::span<const double> limits) noexcept {
  spoiled_ = limits_spoiled_ = false;
  const bool late = count_ >= fewest, due = count_ % fewest == 0;
  for (std::size_t c = 0; c < admitted_.size(); ++c) {
    const bool of_j = c < components_;
    const double value = of_j ? components[c] : limits[c - components_];
    if (late && (due || value < low_[c] || value > high_[c])) bound(c);
    double& admitted = admitted_[c];
    admitted = late ? std::clamp(value, low_[c], high_[c]) : value;
    if (!of_j && value > uppers_[c - components_]) {
      admitted = std::max(admitted, std::min(value, uppers_[c - components_] + 0.5 * (high_[c] - low_[c])));
    }
    ring_[c * static_cast<std::size_t>(room_) + static_cast<std::size_t>(count_ % room_)] = value;
  }
  ++count_;
  known_ = std::min(known_ + 1, room_);
  if (count_ == fewest) {
    for (std::size_t c = 0; c < admitted_.size(); ++c)
      bound(c);
  }
  return admitted_;
}

void Outliers::forget() noexcept {
  count_ = known_ = 0;
  spoiled_ = limits_spoiled_ = false;
  std::fill(low_.begin(), low_.end(), -largest_reading);
  std::fill(high_.begin(), high_.end(), largest_reading);
}

}  // namespace mgdd::optimize
