#include "mgdd/optimize/learning/iterative_learning.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr Domain at_least_zero{.lower = 0.0};

bool is_finite(std::span<const double> column) noexcept {
  return std::all_of(column.begin(), column.end(), [](double value) { return std::isfinite(value); });
}

// Scaled, so that it overflows only where the norm itself does.
double norm_of(std::span<const double> column) noexcept {
  double largest = 0.0;
  for (const double value : column) {
    largest = std::max(largest, std::abs(value));
  }
  if (largest == 0.0) return 0.0;
  double sum = 0.0;
  for (const double value : column) {
    sum += (value / largest) * (value / largest);
  }
  return largest * std::sqrt(sum);
}

}  // namespace

IterativeLearning::IterativeLearning(LearningSettings settings)
    : settings_(std::move(settings)),
      law_(settings_),
      input_(settings_.initial),
      next_(settings_.initial),
      best_input_(settings_.initial) {
  norms_.reserve(history_length);
}

std::span<const double> IterativeLearning::ask() noexcept {
  asked_ = true;
  return input_;
}

LearningStatus IterativeLearning::try_tell(std::span<const double> error) noexcept {
  if (!asked_) return LearningStatus::not_asked;
  if (error.size() != input_.size()) return LearningStatus::wrong_length;
  if (!std::all_of(error.begin(), error.end(), is_reading)) return LearningStatus::not_a_reading;
  const std::span<const double> window = error.subspan(law_.relative_degree());
  const double norm = norm_of(window);

  const bool freeze = frozen_ || (settings_.guard && is_rising(norm));
  if (!freeze) {
    const std::span<double> learned = std::span(next_).first(law_.samples());
    std::copy_n(input_.begin(), learned.size(), learned.begin());
    law_.apply(window, learned);
    if (!is_finite(learned)) return LearningStatus::overflow;
    limit(learned);
    std::fill(next_.begin() + static_cast<std::ptrdiff_t>(learned.size()), next_.end(), learned.back());
  }
  if (!best_norm_ || norm < *best_norm_) {
    best_norm_ = norm;
    best_trial_ = trial_;
    std::copy(input_.begin(), input_.end(), best_input_.begin());
  }
  if (norms_.size() == history_length) norms_.erase(norms_.begin());
  norms_.push_back(norm);
  const std::vector<double>& source = freeze ? best_input_ : next_;
  std::copy(source.begin(), source.end(), input_.begin());
  frozen_ = freeze;
  asked_ = false;
  ++trial_;
  return freeze ? LearningStatus::frozen : LearningStatus::learned;
}

LearningStatus IterativeLearning::tell(std::span<const double> error) {
  const LearningStatus status = try_tell(error);
  const std::string trial = "trial " + std::to_string(trial_);
  switch (status) {
    case LearningStatus::not_asked:
      throw ParameterError(trial + " has not been asked for: call ask() once before each tell()");
    case LearningStatus::wrong_length:
      throw ShapeError("error of " + trial + " has " + std::to_string(error.size()) + " samples: must have " +
                       std::to_string(input_.size()) + ", one per sample of the input");
    case LearningStatus::not_a_reading: {
      const auto at = std::find_if_not(error.begin(), error.end(), is_reading);
      throw DataError("error of " + trial + ", sample " + std::to_string(at - error.begin()), *at,
                      "must be finite and at most " + text(largest_reading) +
                          " in magnitude; repeat the trial, or fill the gap before telling");
    }
    case LearningStatus::overflow:
      throw DataError("error of " + trial +
                      " drives the next input beyond the range of a double: the trials diverge, lower the gain");
    case LearningStatus::learned:
    case LearningStatus::frozen:
      break;
  }
  return status;
}

bool IterativeLearning::is_rising(double norm) const noexcept {
  const std::size_t n = norms_.size();
  return n >= 2 && norm > norms_[n - 1] && norms_[n - 1] > norms_[n - 2];
}

void IterativeLearning::limit(std::span<double> input) const noexcept {
  for (std::size_t t = 0; t < input.size(); ++t) {
    input[t] = std::clamp(input[t], settings_.lower, settings_.upper);
    if (t > 0) input[t] = std::clamp(input[t], input[t - 1] - settings_.rate, input[t - 1] + settings_.rate);
  }
}

void IterativeLearning::restore(const StateColumns& columns) {
  restore_state(*this, columns);
  norms_.reserve(history_length);
}

void IterativeLearning::require_usable() const {
  if (best_norm_.has_value() != (trial_ > 0)) {
    throw ParameterError("state column 'best_norm' must have one entry once a trial was told, and none before");
  }
  if (best_norm_) require_in(at_least_zero, "state column 'best_norm'", *best_norm_);
  for (const double norm : norms_)
    require_in(at_least_zero, "state column 'error_norms'", norm);
  for (const auto& [name, column] : {std::pair{"input", &input_}, std::pair{"best_input", &best_input_}}) {
    for (const double value : *column)
      require_within("state column '" + std::string(name) + "'", value, settings_.lower, settings_.upper);
  }
}

}  // namespace mgdd::optimize
