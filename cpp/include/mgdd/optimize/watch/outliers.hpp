// Readings far outside of what those around them scatter by. What a seeker may learn from one reading is bounded by
// three times the third largest distance of the last readings from their median: what a perturbation or a new level
// does to J is seen more than twice in them and passes. The same of what is limited; but what is above its limit stays
// above. The first readings are looked at once there are enough.
// noexcept and allocation-free after construction.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"

namespace mgdd::optimize {

/// Median of `values`, which are put in another order; at least one.
double median_of(std::span<double> values) noexcept;
/// How far a reading may lie from the median of its like, by their distances from it, which are put in another order.
double farthest_of(std::span<double> distances) noexcept;
/// What the variance of a reading is multiplied by, from the square of its distance in standard deviations: beyond
/// three of them it pulls the less, the farther out it lies.
constexpr double scatter_of(double squared) noexcept {
  const double beyond = squared / 9.0;
  return beyond > 1.0 ? beyond * beyond : 1.0;
}

class Outliers {
 public:
  Outliers(std::size_t components, const std::vector<Limit>& limits, Eigen::Index inputs);

  /// These components of J and these limits behind them, none farther out than the last readings allow; valid until the
  /// next call.
  std::span<const double> admit(std::span<const double> components, std::span<const double> limits) noexcept;
  /// True where the last reading showed that one of the first of J was far out, or one of the first of a limit.
  bool spoiled() const noexcept { return spoiled_; }
  bool limits_spoiled() const noexcept { return limits_spoiled_; }
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("outlier_count", self.count_, counts_end);
    v("outlier_known", self.known_, self.room_ + 1);
    v("outlier_ring", self.ring_);
    v("outlier_low", self.low_);
    v("outlier_high", self.high_);
  }

 private:
  void bound(std::size_t channel) noexcept;

  std::size_t components_;
  std::vector<double> uppers_;  // of the limits
  std::int64_t room_;           // readings of each channel
  std::int64_t count_ = 0, known_ = 0;
  bool spoiled_ = false, limits_spoiled_ = false;
  std::vector<double> ring_, low_, high_, scratch_, admitted_;
};

}  // namespace mgdd::optimize
