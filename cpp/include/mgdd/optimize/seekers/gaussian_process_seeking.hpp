// Seeking with a Gaussian process of J, and one of every limited quantity (Rasmussen and Williams 2006). After a
// reading at the start and one to the side per input, the next input is the one that is worth most: its J, plus what a
// few readings there would teach about the best input (knowledge gradient, Frazier, Powell and Dayanik 2009), used for
// `horizon` cycles. Nothing is asked farther from the start than half as far again as what has been, nor where a limit
// holds with less than the stated probability: the safe set grows from the start (Sui et al. 2015). Readings fade; ones
// that the process cannot explain age all that was known. ask and tell are noexcept and allocation-free; all randomness
// is a function of (seed, cycle).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/seekers/causing_inputs.hpp"
#include "mgdd/optimize/seekers/constraint_filter.hpp"
#include "mgdd/optimize/seekers/process_model.hpp"
#include "mgdd/optimize/seekers/seeker.hpp"

namespace mgdd::optimize {

struct GaussianProcessSeekingSettings {
  SearchSpace space;                 ///< finite bounds
  std::optional<double> noise_sd{};  ///< of one reading of J, > 0; none: learnt
  double horizon = 60.0;             ///< cycles for which what is learnt pays
  double memory_cycles = 143.0;      ///< readings fade with this time constant
  int kept = 100;                    ///< readings at most, 10 to 200
  double first_step = 0.1;           ///< of the first readings to the side, as a share of the bounds
  double limit_probability = 0.95;   ///< with which a limit holds at every input asked for
  ComponentLag sensor{};             ///< between the plant and J
  std::uint64_t seed = 0;
  bool maximize = true;
  std::vector<Limit> limits;
};
inline auto fields_of(const GaussianProcessSeekingSettings&) {
  using S = GaussianProcessSeekingSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::noise_sd>("noise_sd", "of one reading of J"),
      field<&S::horizon>("horizon", "cycles for which what is learnt pays"),
      field<&S::memory_cycles>("memory_cycles", "time constant with which readings fade"),
      field<&S::kept>("kept", "readings at most"),
      field<&S::first_step>("first_step", "of the first readings, share of the bounds"),
      field<&S::limit_probability>("limit_probability", "with which a limit holds at every input asked for"),
      field<&S::sensor, &ComponentLag::delay_cycles>("delay_cycles", "between the plant and J"),
      field<&S::sensor, &ComponentLag::lag_cycles>("lag_cycles", "the same"),
      field<&S::seed>("seed", "of the inputs that are compared"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
  };
}

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
  double noise_sd() const noexcept { return j_.noise_sd(); }
  /// What a reading of J at the estimate is expected to be, and its standard deviation without noise.
  double expected() const noexcept { return expected_; }
  double expected_sd() const noexcept { return expected_sd_; }
  std::int64_t doubts() const noexcept { return doubts_; }
  const GaussianProcessSeekingSettings& settings() const noexcept { return settings_; }
  const Inputs& applied() const noexcept { return protocol_.sent(applied_); }
  const Protocol& protocol() const noexcept { return protocol_; }
  std::size_t component_count() const noexcept { return 1; }
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }
  LimitState limit_state(std::size_t i) const noexcept;
  double limit_delay(std::size_t i) const noexcept { return causes_.delay_cycles(i + 1); }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    require_within_space("estimate", estimate_, settings_.space);
    require_within_space("applied", applied_, settings_.space);
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    Protocol::visit(self.protocol_, v);
    v("estimate", self.estimate_);
    v("applied", self.applied_);
    v("middle", self.middle_);
    v("explored", self.explored_);
    v("star", self.star_, 1 + self.estimate_.size());
    v("held", self.held_);
    v("expected", self.expected_);
    v("expected_sd", self.expected_sd_);
    v("surprise", self.surprise_);
    v("since_doubt", self.since_doubt_);
    v("doubts", self.doubts_);
    v("limit_room", self.room_);
    v("limit_unsafe", self.unsafe_);
    CausingInputs::visit(self.causes_, v, "cause");
    ProcessModel::visit(self.j_, v, "j");
    for (std::size_t i = 0; i < self.limited_.size(); ++i)
      ProcessModel::visit(self.limited_[i], v, "limit" + std::to_string(i));
  }

 private:
  Inputs scaled(const Inputs& input) const noexcept;
  Inputs unscaled(const Inputs& z) const noexcept;
  Inputs reachable(Inputs z) const noexcept;
  double draw(std::uint64_t stream, int index) const noexcept;
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  void watch_surprise(double value, const Inputs& z) noexcept;
  void choose() noexcept;
  void choose_first() noexcept;
  void draw_candidates(const Inputs& about) noexcept;
  void judge_safety(int points) noexcept;
  double excess(std::size_t i, int point) noexcept;
  Inputs best_of_mean(const Inputs& from) noexcept;
  int most_worth(int points) noexcept;
  void send(const Inputs& z) noexcept;

  GaussianProcessSeekingSettings settings_;
  double quantile_;
  std::int64_t hold_;  // cycles for which an input is asked behind a lag
  Protocol protocol_;
  CausingInputs causes_;  // of J, then of the limits
  ProcessModel j_;
  std::vector<ProcessModel> limited_;
  Inputs estimate_, applied_;
  Inputs middle_;          // of what may be explored: the start, scaled
  double explored_ = 0.0;  // largest distance from there of an entry that was asked
  std::int64_t star_ = 0;  // first readings asked for
  std::int64_t held_ = 0;
  double expected_ = 0.0, expected_sd_ = 0.0;
  double surprise_ = 1.0;  // running mean of the squared normalised innovation
  std::int64_t since_doubt_ = 0, doubts_ = 0;
  std::vector<double> room_;    // of every limit at the estimate, in its scale
  std::vector<double> unsafe_;  // cycles in a row in which no input was safe
  // Scratch.
  InputTable candidates_;
  Eigen::MatrixXd covariance_;
  std::vector<double> worth_mean_, effect_, breaks_, over_;
  std::vector<int> order_;
};

}  // namespace mgdd::optimize
