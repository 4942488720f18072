// One set of assumptions about where a curve stands and the readings under it: a point-mass filter (Bucy and Senne
// 1971) over the place T of its maximum, its shape and the class of its scale. Hypothesis (T, shape):
// J = o + S [c(b + (x - T)/w) - c(b)], with c the guide's curve, b its best input, w the width on that side of T.
// The level o is a random walk: readings and drops pass the Kalman filter of a local level (Harvey 1989),
// which is the same for all hypotheses, and what it leaves of them is white. Scale S and the noise are integrated out
// (Rao-Blackwellised; Doucet et al. 2000); old readings fade. S lies near 1, or near another power of the guide's unit,
// or is 0: J does not answer the input. noexcept and allocation-free.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "mgdd/common/state.hpp"

namespace mgdd::guide {

class CurveBank {
 public:
  static constexpr int places = 81;
  static constexpr int shapes = 3;
  static constexpr int hypotheses = places * shapes;
  static constexpr std::size_t classes = 7;
  using Column = Eigen::Array<double, hypotheses, 1>;

  /// What it assumes.
  struct Assumed {
    double memory_cycles = 143.0;  ///< readings fade by exp(-1/memory)
    double drift = 0.0;            ///< variance of the level's step over that of a reading, per cycle
    double slope = 0.0;            ///< standard deviation of the level's slope over that of a reading, per cycle
    double velocity = 0.0;         ///< of the place, in steps between places per cycle, at most half of one
  };
  /// What all banks share.
  struct Prior {
    double first = 0.0, step = 0.0;  ///< places of T
    double scale_sd = 0.3;           ///< of S about 1
    double discrepancy = 0.25;       ///< error of the curve per unit of its drop
    double noise_variance = 1.0;     ///< of a reading: told, or guessed from the curve
    bool noise_told = false;
    Column log_of = Column::Zero();         ///< of place and shape
    Column mass_of = Column::Ones();        ///< its exponential
    Eigen::Array<double, places, 1> place;  ///< from the first one
    double mass = 1.0;                      ///< the sum of that
    double precision = 1.0;                 ///< of T
  };
  struct Prediction {
    double mean = 0.0, variance = 0.0;
  };
  /// The same of a reading that has come, and the density at it.
  struct Foretold {
    Prediction reading;
    double density = 0.0;
  };

  explicit CurveBank(const Assumed& assumed) noexcept;

  /// Nothing is known of J's level and of T but the prior; what was learnt of the noise stays.
  void restart(const Prior& prior) noexcept;
  /// One cycle on, with a reading or without.
  void move(const Prior& prior) noexcept;
  /// How likely this reading is, whose drops under every hypothesis are these. None was taken yet: not defined.
  Foretold foretell(const Prior& prior, const Column& drops, double j) const noexcept;
  /// Adds a reading to the sums alone; `heard` is its weight beside a usual one, in (0, 1].
  void add(const Prior& prior, const Column& drops, double j, double heard) noexcept;
  /// Keeps this share of what the readings said.
  void fade(double kept) noexcept;
  /// The posterior from the sums.
  void judge(const Prior& prior) noexcept;
  /// Reading under these drops as it is expected next.
  Prediction predict(const Prior& prior, const Column& drops) const noexcept;
  /// What another bank has learnt, under the own assumptions from now on.
  void take_over(const CurveBank& other) noexcept;

  double mean() const noexcept { return mean_; }
  double spread() const noexcept { return spread_; }
  /// Standard deviation of the mean that the fading of the readings leaves.
  double faded_sd(const Prior& prior, double spread) const noexcept;
  double stated_sd(const Prior& prior) const noexcept { return faded_sd(prior, spread_); }
  /// The same without what is improbable: where to look, not what to promise.
  double search_sd(const Prior& prior) const noexcept { return faded_sd(prior, usual_spread_); }
  double variance() const noexcept { return noise_variance_; }
  double scale() const noexcept { return scale_; }
  double unexplained() const noexcept { return unexplained_; }
  /// Logarithm of the most that ever spoke against J not answering the input, fading slowly; <= 0.
  double remembered_flat() const noexcept { return remembered_flat_; }
  double readings() const noexcept { return count_; }
  const Assumed& assumed() const noexcept { return assumed_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("count", self.count_);
    v("count_squared", self.count_squared_);
    v("weight", self.weight_);
    v("level_variance", self.level_variance_);
    v("covariance", self.covariance_);
    v("slope_variance", self.slope_variance_);
    v("level_j", self.level_j_);
    v("slope_j", self.slope_j_);
    v("slope", self.slope_);
    v("remembered_flat", self.remembered_flat_);
    v("rest", self.rest_);
    v("level", self.level_);
    v("bend", self.bend_);
    v("cross", self.cross_);
    v("share", self.share_);
    v("own_scale", self.own_scale_);
    v("scale_variance", self.scale_variance_);
    v("class_variance", self.class_variance_);
    v("class_share", self.class_share_);
    v("remembered", self.remembered_);
    v("flat_share", self.flat_share_);
    v("mean", self.mean_);
    v("spread", self.spread_);
    v("usual_spread", self.usual_spread_);
    v("from", self.from_, std::int64_t{places} + 1);
    v("to", self.to_, self.from_, std::int64_t{places} + 1);
    v("noise", self.noise_variance_);
    v("scale", self.scale_);
    v("unexplained", self.unexplained_);
    v("phase", self.phase_);
    v("judged", self.judged_, counts_end);
  }

 private:
  double noise_guess(const Prior& prior, std::size_t k) const noexcept;
  void advance() noexcept;
  double level_variance() const noexcept;
  void find_places(double total) noexcept;
  void remember() noexcept;
  double own_weight(const Prior& prior, const Column& drops) const noexcept;
  const Column& moved(const Column& drops, Column& room) const noexcept;

  Assumed assumed_;
  double fading_;
  double count_ = 0.0, count_squared_ = 0.0, weight_ = 0.0;
  double level_variance_ = 0.0;  // over that of a reading
  double covariance_ = 0.0, slope_variance_ = 0.0;
  double level_j_ = 0.0, slope_j_ = 0.0, rest_ = 0.0;
  Column level_, slope_, bend_, cross_;
  Column share_, own_scale_, scale_variance_;
  std::array<double, classes> class_variance_{}, class_share_{}, remembered_{};
  double flat_share_ = 0.0, remembered_flat_ = 0.0;
  double mean_ = 0.0, spread_ = 0.0, usual_spread_ = 0.0, noise_variance_ = 0.0, scale_ = 1.0, unexplained_ = 0.0;
  double phase_ = 0.0;  // steps from the places as the prior has them to where they are now
  std::int64_t judged_ = 0;
  std::int64_t from_ = 0, to_ = places;  // places that the posterior looks at
};

}  // namespace mgdd::guide
