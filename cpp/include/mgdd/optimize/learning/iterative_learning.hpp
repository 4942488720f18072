// Iterative learning control: improves the input trajectory of a task that is repeated trial by trial.
// Ask for the input of the trial, apply it, tell the error e = r - y: sample t of both belongs to the same instant.
// Units are the caller's. `ask` and `try_tell` neither throw nor allocate; `tell` and `restore` are not real-time
// safe. Source of the laws: Bristow, Tharayil and Alleyne (2006).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/learning/learning_convergence.hpp"
#include "mgdd/optimize/learning/learning_law.hpp"

namespace mgdd::optimize {

/// What became of an error trajectory. After the refusals, from `not_asked` on, everything is as it was.
enum class LearningStatus {
  learned,        ///< the input of the next trial follows from the law
  frozen,         ///< the guard stopped learning, now or before: the next trial repeats the best input so far
  not_asked,      ///< ask() comes first, once per trial
  wrong_length,   ///< not one error per sample
  not_a_reading,  ///< a sample of the error that is NaN or beyond `largest_reading`
  overflow,       ///< next input beyond the range of a double: the trials diverge
};

/// Learns on the samples m..N-1 of the error, which the inputs 0..N-1-m reach; the m inputs behind those act only after
/// the trial and repeat the last learned one. The norm of a trial is the 2-norm over that window.
///
/// New inputs are clipped to [lower, upper], then followed from the first sample on with at most `rate` per sample.
/// With the guard, two rises of the norm in a row end learning and bring the input of the best trial back.
class IterativeLearning {
 public:
  /// Norms kept; older ones are forgotten.
  static constexpr std::size_t history_length = 1000;

  /// Throws ParameterError or ShapeError, naming the field.
  explicit IterativeLearning(LearningSettings settings);

  /// Input of this trial, N samples. Asking again before telling gives the same.
  std::span<const double> ask() noexcept;

  LearningStatus try_tell(std::span<const double> error) noexcept;

  /// The same; a refusal throws ParameterError, ShapeError or DataError, which names the trial and the sample.
  LearningStatus tell(std::span<const double> error);

  /// Linear theory of the law; needs an impulse response. Independent of what has been told.
  [[nodiscard]] ConvergenceReport convergence() const { return optimize::convergence(law_); }

  /// For `save_state`; restore through `restore`, which also keeps room for the norms to come.
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("trial", self.trial_, counts_end);
    v("asked", self.asked_);
    v("frozen", self.frozen_);
    v("best_trial", self.best_trial_, std::max(self.trial_, std::int64_t{1}));
    v("best_norm", self.best_norm_);
    v("input", self.input_);
    v("best_input", self.best_input_);
    v("error_norms", self.norms_, std::min(static_cast<std::size_t>(self.trial_), history_length));
  }

  /// Goes on from saved columns, or throws and changes nothing. The settings must be those of the saved learner.
  void restore(const StateColumns& columns);

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  [[nodiscard]] const LearningSettings& settings() const noexcept { return settings_; }
  [[nodiscard]] const LearningUpdate& law() const noexcept { return law_; }
  [[nodiscard]] std::int64_t trial() const noexcept { return trial_; }  ///< trials told, and number of the one to come
  [[nodiscard]] bool asked() const noexcept { return asked_; }
  [[nodiscard]] bool frozen() const noexcept { return frozen_; }
  [[nodiscard]] std::int64_t best_trial() const noexcept { return best_trial_; }  ///< least norm; 0 before the first
  [[nodiscard]] double best_norm() const noexcept {                               ///< infinite before the first
    return best_norm_.value_or(std::numeric_limits<double>::infinity());
  }
  [[nodiscard]] const std::vector<double>& best_input() const noexcept { return best_input_; }
  [[nodiscard]] const std::vector<double>& error_norms() const noexcept { return norms_; }  ///< of the latest trials

 private:
  [[nodiscard]] bool is_rising(double norm) const noexcept;
  void limit(std::span<double> input) const noexcept;

  LearningSettings settings_;
  LearningUpdate law_;
  std::vector<double> input_, next_, best_input_;
  std::vector<double> norms_;
  std::int64_t trial_ = 0;
  std::int64_t best_trial_ = 0;
  std::optional<double> best_norm_;
  bool asked_ = false;
  bool frozen_ = false;
};

}  // namespace mgdd::optimize
