// Where a known curve stands, from noisy readings of J at any inputs: a mixture of filters (`CurveBank`), each with a
// delay between input and reading and an assumption of memory and of the drift of J's level. Their weights follow
// from how well each foretold the readings, with a small chance that another one is right from now on (dynamic model
// averaging: Raftery, Karny and Ettler 2010). Delays are compared under the same assumptions, a level that hardly moves
// and one that does; the most probable delay has all of them. A reading far off counts for less, for no delay much.
// Shapes: as the guide says, and steep on one side, which is what a knock limit or a cliff looks like.
// A first-order lag of the sensor is part of every hypothesis. noexcept and allocation-free after construction.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/guide/curve.hpp"
#include "mgdd/guide/curve_bank.hpp"

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
  int earlier = 0, later = 0;    ///< cycles by which the delay may be shorter or longer than told, >= 0
};

/// ParameterError naming field, value and bound.
void validate(const CurveFilterSettings& settings);

class CurveFilter {
 public:
  static constexpr int places = CurveBank::places;
  using Column = CurveBank::Column;
  using Prediction = CurveBank::Prediction;

  /// The settings must be valid and the curve bend down at its best input.
  CurveFilter(const CurveFilterSettings& settings, const Curve& curve);

  /// Takes what was read; `input` is the one that caused it at the shortest delay. The square of how far the reading
  /// was off, over its expected variance; NaN for the first one.
  double learn(double input, double j) noexcept;
  /// A cycle at this input without a reading.
  void pass(double input) noexcept;
  /// Reading as it is expected next, and its variance, where `input` follows at the shortest delay.
  Prediction predict(double input) const noexcept;

  /// Readings were not as expected: banks of short memory keep this share of theirs and have half of all weight from
  /// now on. What the others know stays until these foretell better.
  void doubt(double kept) noexcept;
  /// Another curve at the same operating point, T known to `sd` about its best input: the readings stand.
  void believe(const Curve& curve, double sd) noexcept;
  /// Another curve or operating point: nothing of J's level is known, T is expected about `mean`.
  void restart(const Curve& curve, double mean, double sd) noexcept;

  double mean() const noexcept { return mean_; }      ///< of T
  double spread() const noexcept { return spread_; }  ///< of T as Bayes' rule states it
  /// Standard deviation of the estimate that the fading of the readings leaves, and the same as it covers in practice.
  double search_sd() const noexcept { return search_sd_; }
  double stated_sd() const noexcept { return stated_sd_; }
  double noise_sd() const noexcept;  ///< of a reading, as learnt
  /// Mean square of what the curve leaves of the readings, and the square of the drop that counts as small.
  double unexplained_variance() const noexcept { return unexplained_; }
  double small_variance() const noexcept { return scale_ * scale_ * guessed_variance(); }
  double curvature() const noexcept;  ///< J'' of the curve as scaled, < 0
  double scale() const noexcept { return scale_; }
  /// Logarithm of how much likelier the readings have made it that J answers the input; >= 0.
  double answer_evidence() const noexcept { return -banks_[leader() * common].remembered_flat(); }
  double readings() const noexcept { return banks_[0].readings(); }  ///< that count now
  /// Cycles that the most probable delay is longer than told.
  int delay_error() const noexcept { return offset_of(leader()); }
  const Curve& curve() const noexcept { return curve_; }
  const CurveFilterSettings& settings() const noexcept { return settings_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    Prefixed<V> curve{v, "curve."};
    Curve::visit(self.curve_, curve);
    v("filter_bend", self.bend_);
    v("filter_prior_mean", self.prior_mean_);
    v("filter_prior_extra", self.prior_extra_);
    v("filter_started", self.started_);
    v("filter_lagged", self.lagged_);
    v("filter_cycles", self.cycles_, counts_end);
    for (std::size_t i = 0; i < self.ring_.size(); ++i)
      v("filter_ring" + std::to_string(i), self.ring_[i]);
    v("filter_delays", self.delay_weights_, self.delay_weights_.size());
    v("filter_assumptions", self.assumption_weights_, self.assumption_weights_.size());
    v("filter_leader", self.leader_, static_cast<std::int64_t>(self.delays_));
    for (std::size_t i = 0; i < self.banks_.size(); ++i) {
      const std::string name = "bank" + std::to_string(i) + "_";
      Prefixed<V> bank{v, name};
      CurveBank::visit(self.banks_[i], bank);
    }
    for (const auto& [name, place] : mixed(self))
      v(name, *place);
  }

 private:
  static constexpr std::size_t common = 2;  // assumptions that every delay has a bank of
  template <class Self>
  static auto mixed(Self& self) {
    using Place = decltype(&self.mean_);
    return std::array<std::pair<const char*, Place>, 7>{{{"filter_mean", &self.mean_},
                                                         {"filter_spread", &self.spread_},
                                                         {"filter_search_sd", &self.search_sd_},
                                                         {"filter_stated_sd", &self.stated_sd_},
                                                         {"filter_variance", &self.variance_},
                                                         {"filter_scale", &self.scale_},
                                                         {"filter_unexplained", &self.unexplained_}}};
  }
  std::size_t leader() const noexcept { return static_cast<std::size_t>(leader_); }
  int offset_of(std::size_t delay) const noexcept { return static_cast<int>(delay) - settings_.earlier; }
  std::size_t shared() const noexcept { return delays_ * common; }
  std::size_t delay_of(std::size_t bank) const noexcept { return bank < shared() ? bank / common : leader(); }
  std::size_t assumption_of(std::size_t bank) const noexcept {
    return bank < shared() ? bank % common : bank - shared() + common;
  }
  double weight_of(std::size_t bank) const noexcept;
  bool is_turn_of(std::size_t i) const noexcept;
  bool compared(std::size_t delay) const noexcept;
  double delay_prior(std::size_t delay) const noexcept;
  Prediction expected() const noexcept;
  const Column& drops_at(std::int64_t cycle, std::size_t delay) const noexcept;
  void fill_drops(double input, Column& drops) const noexcept;
  void weigh() noexcept;
  void give_up_the_refuted() noexcept;
  void mix() noexcept;
  void expect(const Curve& curve, double mean, double sd) noexcept;
  void place_prior() noexcept;
  double guessed_variance() const noexcept;

  CurveFilterSettings settings_;
  Curve curve_;
  CurveBank::Prior prior_;
  double per_lag_;  // share of the way that the lag goes in one cycle
  double fading_;
  std::size_t delays_;
  double bend_ = 0.0;                            // of the curve
  double prior_mean_ = 0.0, prior_extra_ = 0.0;  // precision of the prior beyond that of `prior_sd`; it fades
  bool started_ = false;                         // the lag has an input
  Column lagged_;
  std::vector<Column> ring_;                   // drops behind the lag, of the last cycles
  std::int64_t cycles_ = 0;                    // since the start
  std::vector<CurveBank> banks_;               // `common` ones of every delay in turn, then the leader's others
  std::vector<CurveBank::Foretold> foretold_;  // the latest reading, by bank: a working place
  std::vector<double> delay_weights_, assumption_weights_;
  std::int64_t leader_ = 0;
  double mean_ = 0.0, spread_ = 0.0, search_sd_ = 0.0, stated_sd_ = 0.0;
  double variance_ = 0.0, scale_ = 1.0, unexplained_ = 0.0;
};

}  // namespace mgdd::guide
