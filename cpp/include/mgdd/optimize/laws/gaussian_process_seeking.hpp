// Seeking with a Gaussian process of J, and one of every limited quantity (Rasmussen and Williams 2006). After a
// reading at the start and one to the side per input, the next input is the one that is worth most: its J, plus what a
// few readings there would teach about the best input (knowledge gradient, Frazier, Powell and Dayanik 2009), used for
// `horizon` cycles. With a guide the readings to the side are left out: what a rough model says of J is the mean of the
// process, whose factor, place and error are learnt. Nothing is asked farther beyond what was read than a part of its
// width, with a guide a fifth of the bounds where nothing is limited, nor where a limit may break in forty cycles by
// more than the stated probability lets it: the safe set grows from the start (Sui et al. 2015), nor where cycles are
// likely to fail, as one more process knows. Along limits that hold the best input back it reads what it knows least
// of. Level and place wander; readings that the process cannot explain, two in a row, age all that was known. Where
// several inputs in a row stay at the estimate, the search is over: a small dither, as large as noise and wandering
// make it pay, goes on until a doubt. ask and tell are noexcept and allocation-free; all randomness is a function of
// (seed, cycle).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/belief/process_model.hpp"
#include "mgdd/optimize/laws/climb.hpp"
#include "mgdd/optimize/laws/most_worth.hpp"
#include "mgdd/optimize/limits/failing_process.hpp"
#include "mgdd/optimize/limits/limit_process.hpp"
#include "mgdd/optimize/limits/nearest_step.hpp"
#include "mgdd/optimize/watch/causing_inputs.hpp"
#include "mgdd/optimize/watch/delay_finder.hpp"
#include "mgdd/optimize/watch/lag_window.hpp"
#include "mgdd/optimize/watch/surprise.hpp"

namespace mgdd::optimize {

struct GaussianProcessSeekingSettings {
  SearchSpace space;                       ///< finite bounds
  std::optional<double> noise_sd{};        ///< of one reading of J, > 0; none: learnt
  double horizon = 60.0;                   ///< cycles for which what is learnt pays
  double memory_cycles = 143.0;            ///< in which level and place are expected to wander by what counts
  int kept = 100;                          ///< readings at most, 10 to 200
  double first_step = 0.1;                 ///< of the first readings to the side, as a share of the bounds
  double limit_probability = 0.95;         ///< with which a limit holds at the estimate, and in forty cycles
  ComponentLag sensor{};                   ///< between the plant and J, where it has one component
  std::vector<ComponentLag> components{};  ///< the same of every component of J; empty: J is one
  int delay_uncertainty = 4;               ///< cycles by which a delay may be shorter or longer: it is learnt
  std::uint64_t seed = 0;
  bool maximize = true;
  std::vector<Limit> limits;
  std::vector<Surface> guide{};         ///< what a model says of every component of J, or none at all
  std::vector<Surface> limit_guides{};  ///< the same of every limit
};
inline auto fields_of(const GaussianProcessSeekingSettings&) {
  using S = GaussianProcessSeekingSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::noise_sd>("noise_sd", "of one reading of J"),
      field<&S::horizon>("horizon", "cycles for which what is learnt pays"),
      field<&S::memory_cycles>("memory_cycles", "in which level and place are expected to wander by what counts"),
      field<&S::kept>("kept", "readings at most"),
      field<&S::first_step>("first_step", "of the first readings, share of the bounds"),
      field<&S::limit_probability>("limit_probability",
                                   "with which a limit holds at the estimate, and in forty cycles"),
      field<&S::sensor, &ComponentLag::delay_cycles>("delay_cycles", "between the plant and J"),
      field<&S::sensor, &ComponentLag::lag_cycles>("lag_cycles", "the same"),
      field<&S::components>("components", "delay and lag of each component of J", DefaultForm::none),
      field<&S::delay_uncertainty>("delay_uncertainty", "cycles by which a delay may be shorter or longer"),
      field<&S::seed>("seed", "of the inputs that are compared"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::guide>("guide", "what a model says of J", DefaultForm::none),
      field<&S::limit_guides>("limit_guides", "the same of every limit", DefaultForm::none),
  };
}

/// With what is left open filled in. Throws ParameterError or ShapeError naming the field.
GaussianProcessSeekingSettings resolved(GaussianProcessSeekingSettings settings);

class GaussianProcessSeeking {
 public:
  /// Throws ParameterError or ShapeError naming the field.
  explicit GaussianProcessSeeking(GaussianProcessSeekingSettings settings);

  const Inputs& ask() noexcept { return protocol_.ask(applied_); }
  TellStatus tell(const Reading& reading) noexcept;
  /// New operating point: what was learnt is void, the estimate stays, and the search begins anew around it.
  void restart() noexcept;
  /// Moves the estimate, within the bounds, and the next input with it; what was learnt stays.
  void shift_estimate(const Inputs& by) noexcept;
  void reseed(std::uint64_t seed) noexcept;

  const Inputs& estimate() const noexcept { return estimate_; }
  double noise_sd() const noexcept;
  /// What a reading of J at the estimate is expected to be, and its standard deviation without noise.
  double expected() const noexcept { return expected_; }
  double expected_sd() const noexcept { return expected_sd_; }
  std::int64_t doubts() const noexcept { return doubts_; }
  /// What the guide is multiplied by, as learnt: about 1 where it is right, towards 0 where it says nothing.
  double guide_factor(std::size_t component = 0) const noexcept { return j_[component].guide_factor(); }
  /// Least share of the bends of J that a guide holds, as learnt; 1 without a guide.
  double trust() const noexcept;
  /// Whole cycles between input and reading of a component that explain the readings best.
  double delay_cycles(std::size_t component = 0) const noexcept {
    return static_cast<double>(finders_[component].delay());
  }
  const GaussianProcessSeekingSettings& settings() const noexcept { return settings_; }
  const Inputs& applied() const noexcept { return protocol_.sent(applied_); }
  const Protocol& protocol() const noexcept { return protocol_; }
  std::size_t component_count() const noexcept { return j_.size(); }
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }
  LimitState limit_state(std::size_t i) const noexcept;
  double limit_delay(std::size_t i) const noexcept { return causes_.delay_cycles(i); }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    require_within_space("estimate", estimate_, settings_.space);
    require_within_space("applied", applied_, settings_.space);
    failing_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    Protocol::visit(self.protocol_, v);
    v("estimate", self.estimate_);
    v("applied", self.applied_);
    v("middle", self.middle_);
    v("good", self.good_);
    v("lowest", self.lowest_);
    v("highest", self.highest_);
    v("star", self.star_, counts_end);
    v("held", self.held_, counts_end);
    v("rested", self.rested_, counts_end);
    v("since_failure", self.since_failure_, counts_end);
    v("wary", self.wary_, counts_end);
    v("expected", self.expected_);
    v("expected_sd", self.expected_sd_);
    for (std::size_t i = 0; i < self.surprise_.size(); ++i)
      Surprise::visit(self.surprise_[i], v, "surprise" + std::to_string(i));
    v("since_doubt", self.since_doubt_, counts_end);
    v("doubts", self.doubts_, counts_end);
    v("limit_room", self.room_);
    v("limit_unsafe", self.unsafe_);
    CausingInputs::visit(self.causes_, v, "cause");
    for (std::size_t i = 0; i < self.finders_.size(); ++i)
      DelayFinder::visit(self.finders_[i], v, "delay" + std::to_string(i));
    for (std::size_t i = 0; i < self.windows_.size(); ++i)
      LagWindow::visit(self.windows_[i], v, "window" + std::to_string(i));
    for (std::size_t i = 0; i < self.j_.size(); ++i)
      ProcessModel::visit(self.j_[i], v, i == 0 ? "j" : "j" + std::to_string(i));
    for (std::size_t i = 0; i < self.limited_.size(); ++i)
      LimitProcess::visit(self.limited_[i], v, "limit" + std::to_string(i));
    FailingProcess::visit(self.failing_, v);
  }

 private:
  static constexpr int far_candidates = 8, near_candidates = 47, candidates = 2 + far_candidates + near_candidates;
  static constexpr double active_room = 0.05;    // scales of a limit
  static constexpr std::int64_t least_wary = 2;  // cycles that work, after a failure
  static constexpr int most_on_their_way = 8;    // inputs whose readings have not come, that are counted on
  Inputs scaled(const Inputs& input) const noexcept;
  Inputs unscaled(const Inputs& z) const noexcept;
  Inputs reachable(Inputs z) const noexcept;
  Inputs grid() const noexcept;  // steps of the inputs, scaled
  double draw(std::uint64_t stream, int index) const noexcept;
  void fit(const Inputs& about) noexcept;
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  void begin_anew(std::size_t component) noexcept;
  void watch_surprise(std::size_t component, double odd) noexcept;
  void doubt() noexcept;
  void take_in(std::size_t component, int points) noexcept;
  double mean(int point) const noexcept;
  void choose() noexcept;
  void choose_first() noexcept;
  bool guided() const noexcept;
  void draw_candidates() noexcept;
  double dither() const noexcept;
  void judge(double likely, double mean, int point) noexcept;
  void judge_safety(int points, double quantile, const FailingProcess::Demand& works) noexcept;
  void keep_safe(int points) noexcept;
  bool pull_back(int points) noexcept;
  double side_step() const noexcept;
  Inputs best_of_mean(const Inputs& from) noexcept;
  int most_worth(int points) noexcept;
  int most_along(int safe) const noexcept;
  void explore(const Inputs& z) noexcept;
  void send(const Inputs& z) noexcept;

  GaussianProcessSeekingSettings settings_;
  double quantile_, cautious_quantile_;  // of the estimate, and of what is asked for
  std::int64_t hold_;                    // cycles for which an input is asked behind a lag
  Protocol protocol_;
  CausingInputs causes_;              // of the limits
  std::vector<DelayFinder> finders_;  // of the components
  std::vector<LagWindow> windows_;    // of the components, then of the limits
  std::vector<ProcessModel> j_;       // of its components
  std::vector<LimitProcess> limited_;
  FailingProcess failing_;
  Inputs estimate_, applied_;
  Inputs middle_;            // the start, scaled
  Inputs good_;              // the input that worked last, scaled
  Inputs lowest_, highest_;  // of each input that was asked, scaled
  std::int64_t star_ = 0;    // first readings asked for
  std::int64_t held_ = 0;
  std::int64_t since_failure_ = 0, wary_ = least_wary;  // cycles; so many of them nothing is asked that may fail
  std::int64_t rested_ = 0;                             // inputs in a row that stayed at the estimate
  double expected_ = 0.0, expected_sd_ = 0.0;
  std::vector<Surprise> surprise_;  // of the components
  std::int64_t since_doubt_ = 0, doubts_ = 0;
  std::vector<double> room_;    // of every limit at the estimate, in its scale
  std::vector<double> unsafe_;  // cycles in a row in which no input was safe
  // Scratch.
  InputTable candidates_, edges_;  // slopes of every limit in its scale at the estimate
  Eigen::MatrixXd covariance_, own_;
  Eigen::VectorXd means_;
  std::vector<double> effect_, over_, mean_over_;
  InputTable excess_;  // of every limit at the candidates
  std::vector<double> edge_over_;
  Inputs aside_;  // of an input, for slopes
  Climb climb_;
  std::vector<double> multipliers_, credit_;  // J per scale of a limit
  NearestStep nearest_;
  std::vector<int> order_;
  WorthScratch worth_;
};

}  // namespace mgdd::optimize
