// Where a known curve stands: a point-mass filter (Bucy and Senne 1971) over the place T of its maximum and over its
// shape, from noisy readings of J at any inputs. Hypothesis (T, shape): J = o + S [c(b + (x - T)/w) - c(b)], with c the
// guide's curve, b its best input and w the width on that side of T. Offset o and scale S are integrated out as in a
// linear regression, the noise as in Student's t (Rao-Blackwellised; Doucet et al. 2000); old readings fade, and with
// them all that the prior says beyond its widest. A reading counts alike in every hypothesis, the less the lower on the
// curve it lies: weights that differed would favour the hypotheses to which every reading is a near one.
// Shapes: as the guide says, and steep on one side, which is what a knock limit or a cliff looks like.
// A first-order lag of the sensor is part of every hypothesis. noexcept and allocation-free after construction.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "mgdd/common/state.hpp"
#include "mgdd/guide/curve.hpp"

namespace mgdd::guide {

struct CurveFilterSettings {
  double lower = 0.0, upper = 1.0;  ///< of T, finite
  double prior_sd = 0.25;           ///< of T about the guide's best input, > 0, input unit
  double scale_sd = 0.3;            ///< of S about 1, > 0
  double discrepancy = 0.25;        ///< error of the curve per unit of its drop: far readings count less, >= 0
  /// Of one reading of J, > 0; none: learnt from a guess that the curve suggests.
  std::optional<double> noise_sd{};
  double memory_cycles = 143.0;  ///< readings fade by exp(-1/memory), > 1
  double lag_cycles = 0.0;       ///< time constant between the plant and J, >= 0
};

/// ParameterError naming field, value and bound.
void validate(const CurveFilterSettings& settings);

class CurveFilter {
 public:
  static constexpr int places = 81;
  static constexpr int shapes = 3;
  static constexpr int hypotheses = places * shapes;
  using Column = Eigen::Array<double, hypotheses, 1>;

  /// The settings must be valid and the curve bend down at its best input.
  CurveFilter(const CurveFilterSettings& settings, const Curve& curve) noexcept;

  /// Takes what was read at this input.
  void learn(double input, double j) noexcept;
  /// A cycle at this input without a reading: the sensor's lag goes on.
  void pass(double input) noexcept;

  /// Reading at this input as it is expected next, and its variance.
  struct Prediction {
    double mean = 0.0, variance = 0.0;
  };
  Prediction predict(double input) const noexcept;

  /// Keeps this share of what the readings said, and the last few in full; the sensor's lag and the prior stay.
  void forget(double kept) noexcept;
  /// Another curve at the same operating point, T known to `sd` about its best input: the readings stand.
  void believe(const Curve& curve, double sd) noexcept;
  /// Another curve or operating point: nothing of J's level is known, T is expected about `mean`.
  void restart(const Curve& curve, double mean, double sd) noexcept;

  double mean() const noexcept { return mean_; }      ///< of T
  double spread() const noexcept { return spread_; }  ///< of T as Bayes' rule states it
  /// Standard deviation of the estimate that the fading of the readings leaves, and the same as it covers in practice.
  double search_sd() const noexcept { return faded_sd(1.0); }
  double stated_sd() const noexcept;
  double noise_sd() const noexcept;  ///< of a reading, as learnt
  /// Mean square of what the curve leaves of the readings, and the square of the drop that counts as small.
  double unexplained_variance() const noexcept { return unexplained_; }
  double small_variance() const noexcept { return guessed_variance(); }
  double curvature() const noexcept;  ///< J'' of the curve as scaled, < 0
  double scale() const noexcept { return scale_; }
  double readings() const noexcept { return count_; }  ///< that count now
  const Curve& curve() const noexcept { return curve_; }
  const CurveFilterSettings& settings() const noexcept { return settings_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    Prefixed<V> curve{v, "curve."};
    Curve::visit(self.curve_, curve);
    v("filter_bend", self.bend_);
    v("filter_count", self.count_);
    v("filter_count_squared", self.count_squared_);
    v("filter_weight", self.weight_);
    v("filter_y", self.y_);
    v("filter_yy", self.yy_);
    v("filter_prior_mean", self.prior_mean_);
    v("filter_prior_extra", self.prior_extra_);
    v("filter_mean", self.mean_);
    v("filter_spread", self.spread_);
    v("filter_variance", self.variance_);
    v("filter_scale", self.scale_);
    v("filter_unexplained", self.unexplained_);
    v("filter_origin", self.origin_);
    const char* names[] = {"c", "cc", "cy", "lagged", "share", "own_scale"};
    for (std::size_t i = 0; i < self.sums_.size(); ++i)
      v(std::string("filter_") + names[i], self.sums_[i]);
    v("filter_started", self.started_);
    v("filter_recent", self.recent_j_);
    v("filter_recent_count", self.recent_count_);
    for (std::size_t i = 0; i < recent; ++i)
      v("filter_recent" + std::to_string(i), self.recent_drops_[i]);
  }

 private:
  enum Sum : std::size_t { c, cc, cy, lagged, share, own_scale, sums };
  static constexpr std::size_t recent = 3;  // readings that survive a doubt
  void fill_drops(double input, Column& drops) const noexcept;
  void add(const Column& drops, double j) noexcept;
  void judge() noexcept;
  double faded_sd(double factor) const noexcept;
  double prior_precision() const noexcept;
  void expect(const Curve& curve, double mean, double sd) noexcept;
  double guessed_variance() const noexcept;

  CurveFilterSettings settings_;
  Curve curve_;
  double per_lag_;  // share of the way that the lag goes in one cycle
  double fading_;
  double bend_ = 0.0;                            // of the curve
  double prior_mean_ = 0.0, prior_extra_ = 0.0;  // precision of the prior beyond that of `prior_sd`; it fades
  double count_ = 0.0, count_squared_ = 0.0;     // readings that have not faded, and sum of their squares
  double weight_ = 0.0, y_ = 0.0, yy_ = 0.0;     // weighted: the readings, J and J^2
  double mean_ = 0.0, spread_ = 0.0, variance_ = 0.0, scale_ = 1.0;
  double unexplained_ = 0.0;
  double origin_ = 0.0;   // first reading, taken off before summing
  bool started_ = false;  // the lag has an input
  std::array<Column, sums> sums_;
  std::array<Column, recent> recent_drops_;  // a ring, with the readings that belong to it
  std::array<double, recent> recent_j_{};
  std::int64_t recent_count_ = 0;
};

}  // namespace mgdd::guide
