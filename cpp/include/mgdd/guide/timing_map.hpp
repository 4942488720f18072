// A look-up table of the best timing over one or two axes, such as speed and fuel, that learns from confirmed optima.
// Between the cells the value is bilinear, outside of them that of the edge. One optimum y with the standard deviation
// s is shared by its cells with their bilinear weights w, as a Kalman filter with a diagonal covariance P does:
//   P <- P / forgetting^w  (at most the prior),  K = P w / (sum w^2 P + s^2),  v <- v + K (y - sum w v),  P <- (1 - K
//   w) P.
// Timings in °CA aTDC, axes in their own units. `lookup` and `learn` are noexcept and allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/math/tables.hpp"

namespace mgdd::guide {

struct TimingMapSettings {
  std::vector<std::vector<double>> axes;  ///< one or two, each finite and strictly increasing, two entries at least
  std::vector<double> values_cad;         ///< of every cell, the last axis fastest
  double prior_sd_cad = 3.0;              ///< of a value that was never learnt, > 0
  double forgetting = 0.95;               ///< of what a cell knows, per confirmed optimum there, in (0, 1]; 1 = never
};
void validate(const TimingMapSettings& settings);

struct TimingLookup {
  double value_cad = 0.0;
  double sd_cad = 0.0;        ///< of the value, the errors of the cells taken as independent
  double support = 0.0;       ///< confirmed optima behind it, forgotten ones taken off
  bool held_outside = false;  ///< the point lies outside of the axes: the value is that of the edge
};

class TimingMap {
 public:
  /// ParameterError or ShapeError naming the field.
  explicit TimingMap(TimingMapSettings settings);

  /// One coordinate per axis; NaN coordinates give NaN, and so do too few.
  TimingLookup lookup(std::span<const double> point) const noexcept;
  /// False, and nothing is learnt, for a point outside of the axes or numbers out of their domain.
  bool learn(std::span<const double> point, double value_cad, double sd_cad) noexcept;

  const TimingMapSettings& settings() const noexcept { return settings_; }
  const std::vector<double>& values_cad() const noexcept { return values_; }
  const std::vector<double>& variances() const noexcept { return variance_; }  ///< [CAD^2]
  const std::vector<double>& support() const noexcept { return support_; }

  /// ParameterError for a restored state that cannot be.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("values_cad", self.values_);
    v("variance", self.variance_);
    v("support", self.support_);
  }

 private:
  static constexpr std::size_t corners = 4;
  /// On one axis the last two weights are zero.
  struct Place : TablePlace<corners> {
    bool known = false;
  };
  Place place_of(std::span<const double> point) const noexcept;

  TimingMapSettings settings_;
  std::vector<double> values_, variance_, support_;
};

}  // namespace mgdd::guide
