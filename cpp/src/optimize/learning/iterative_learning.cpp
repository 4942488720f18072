#include "mgdd/optimize/learning/iterative_learning.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double largest_count = 9007199254740992.0;  // 2^53: beyond it a double no longer counts

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

struct Scalar {
  const char* name;
  double largest;
};

void check_count(const IterativeLearning::State& state, const Scalar& scalar) {
  const double value = state.at(scalar.name).front();
  if (!(value >= 0.0 && value <= scalar.largest && value == std::floor(value))) {
    throw ParameterError("state: " + std::string(scalar.name) + " = " + text(value) +
                         ": must be a whole number in [0, " + text(scalar.largest) + "]");
  }
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
  if (norm < best_norm_) {
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

IterativeLearning::State IterativeLearning::state() const {
  const bool started = !norms_.empty();
  return {{"trial", {static_cast<double>(trial_)}},
          {"asked", {asked_ ? 1.0 : 0.0}},
          {"frozen", {frozen_ ? 1.0 : 0.0}},
          {"best_trial", {static_cast<double>(best_trial_)}},
          {"best_norm", started ? std::vector<double>{best_norm_} : std::vector<double>{}},
          {"input", input_},
          {"best_input", best_input_},
          {"error_norms", norms_}};
}

void IterativeLearning::restore(const State& state) {
  const State own = this->state();
  for (const auto& [name, column] : state) {
    if (!own.contains(name)) throw ParameterError("state has a column '" + name + "' that no learner writes");
    for (std::size_t i = 0; i < column.size(); ++i) {
      if (!std::isfinite(column[i])) {
        throw ParameterError("state: " + name + "[" + std::to_string(i) + "] = " + text(column[i]) +
                             ": must be finite");
      }
    }
  }
  for (const auto& [name, column] : own) {
    if (!state.contains(name)) throw ParameterError("state lacks the column '" + name + "'");
  }
  const auto require_length = [&](const char* name, std::size_t length) {
    const std::size_t found = state.at(name).size();
    if (found != length) {
      throw ShapeError("state: " + std::string(name) + " has " + std::to_string(found) + " values: must have " +
                       std::to_string(length));
    }
  };
  for (const char* name : {"trial", "asked", "frozen", "best_trial"}) {
    require_length(name, 1);
  }
  for (const Scalar& scalar : {Scalar{"trial", largest_count}, {"asked", 1.0}, {"frozen", 1.0}}) {
    check_count(state, scalar);
  }
  const double trial = state.at("trial").front();
  check_count(state, {"best_trial", std::max(trial - 1.0, 0.0)});
  require_length("input", input_.size());
  require_length("best_input", input_.size());
  require_length("best_norm", trial > 0.0 ? 1 : 0);
  require_length("error_norms", static_cast<std::size_t>(std::min(trial, static_cast<double>(history_length))));
  for (const char* name : {"best_norm", "error_norms"}) {
    for (const double norm : state.at(name)) {
      if (norm < 0.0) throw ParameterError("state: " + std::string(name) + " = " + text(norm) + ": must be >= 0");
    }
  }
  for (const char* name : {"input", "best_input"}) {
    for (const double value : state.at(name)) {
      if (value < settings_.lower || value > settings_.upper) {
        throw ParameterError("state: " + std::string(name) + " = " + text(value) + ": must be in [" +
                             text(settings_.lower) + ", " + text(settings_.upper) + "] of this learner");
      }
    }
  }
  input_ = state.at("input");
  best_input_ = state.at("best_input");
  norms_.assign(state.at("error_norms").begin(), state.at("error_norms").end());
  best_norm_ = trial > 0.0 ? state.at("best_norm").front() : std::numeric_limits<double>::infinity();
  trial_ = static_cast<std::size_t>(trial);
  best_trial_ = static_cast<std::size_t>(state.at("best_trial").front());
  asked_ = state.at("asked").front() != 0.0;
  frozen_ = state.at("frozen").front() != 0.0;
}

}  // namespace mgdd::optimize
