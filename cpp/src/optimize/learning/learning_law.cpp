#include "mgdd/optimize/learning/learning_law.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <Eigen/Eigenvalues>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double default_gain = 0.5;       // times 1 / h_m: halves the error of a plant without memory
constexpr double default_cutoff = 0.2;     // of Nyquist
constexpr double default_change = 0.1;     // of sigma_max(G)^2: the strongest direction keeps 1/11 of its error
constexpr double negligible = 1e-12;       // of the largest |h|: counts as zero when m is counted
constexpr double least_condition = 1e-13;  // of G^T We G + Wu + Wd: below, its solution has no digit left

void require_finite(const std::vector<double>& column, const char* name) {
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (!std::isfinite(column[i])) {
      throw ParameterError(std::string(name) + "[" + std::to_string(i) + "]", column[i], "must be finite");
    }
  }
}

void require_finite(std::optional<double> value, const char* name) {
  if (value && !std::isfinite(*value)) {
    throw ParameterError(name, *value, "must be finite");
  }
}

void require_unused(bool given, const char* name, LearningLaw law) {
  if (given) {
    throw about(name, ParameterError(std::string(name) + " does nothing for law '" + std::string(name_of(law)) +
                                     "': leave it out, or choose another law"));
  }
}

void check_use(const LearningSettings& s) {
  const bool optimal = s.law == LearningLaw::norm_optimal;
  const bool filtered = s.law == LearningLaw::q_filter;
  require_unused(s.k_p && (optimal || s.law == LearningLaw::d), "k_p", s.law);
  require_unused(s.k_d && s.law != LearningLaw::d && s.law != LearningLaw::pd, "k_d", s.law);
  require_unused(!s.learning_function.empty() && !filtered, "learning_function", s.law);
  require_unused(s.lead && !filtered, "lead", s.law);
  require_unused(s.cutoff && optimal, "cutoff", s.law);
  require_unused(s.error_weight && !optimal, "error_weight", s.law);
  require_unused(s.input_weight && !optimal, "input_weight", s.law);
  require_unused(s.change_weight && !optimal, "change_weight", s.law);
  if (s.k_p && !s.learning_function.empty()) {
    throw ParameterError("k_p", *s.k_p, "give k_p or learning_function, not both");
  }
  if (s.lead && s.learning_function.empty()) {
    throw ParameterError("lead", *s.lead, "needs a learning_function");
  }
}

void check_input(const LearningSettings& s) {
  if (s.initial.empty()) {
    throw about("initial", ShapeError("initial is empty: give the input of trial 0, one value per sample"));
  }
  require_finite(s.initial, "initial");
  if (!(s.lower < s.upper)) {
    throw ParameterError("lower", s.lower, "must be < upper = " + text(s.upper));
  }
  if (!(s.rate > 0.0)) {
    throw ParameterError("rate", s.rate, "must be > 0, the largest change from sample to sample");
  }
  for (std::size_t i = 0; i < s.initial.size(); ++i) {
    const double value = s.initial[i];
    const std::string name = "initial[" + std::to_string(i) + "] = " + text(value);
    if (value < s.lower || value > s.upper) {
      throw about(name, ParameterError(name + ": must be in [" + text(s.lower) + ", " + text(s.upper) + "]"));
    }
    if (i > 0 && std::abs(value - s.initial[i - 1]) > s.rate * (1.0 + 1e-12)) {
      throw about(name, ParameterError(name + ": differs from the sample before by more than rate = " + text(s.rate)));
    }
  }
}

}  // namespace

Eigen::MatrixXd toeplitz(const Eigen::VectorXd& column) {
  const Eigen::Index n = column.size();
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    matrix.col(k).tail(n - k) = column.head(n - k);
  }
  return matrix;
}

LearningUpdate::LearningUpdate(const LearningSettings& settings) {
  check_input(settings);
  check_use(settings);
  resolve_model(settings);
  if (settings.law == LearningLaw::norm_optimal) {
    resolve_weights(settings);
  } else {
    resolve_gains(settings);
  }
}

void LearningUpdate::resolve_model(const LearningSettings& s) {
  const std::size_t samples = s.initial.size();
  const std::vector<double>& h = s.impulse_response;
  require_finite(h, "impulse_response");
  if (s.relative_degree && !(*s.relative_degree >= 0 && static_cast<std::size_t>(*s.relative_degree) < samples)) {
    throw ParameterError(
        "relative_degree", *s.relative_degree,
        "must be in 0.." + std::to_string(samples - 1) + " for trials of " + std::to_string(samples) + " samples");
  }
  m_ = static_cast<std::size_t>(s.relative_degree.value_or(0));
  if (!h.empty()) {
    double largest = 0.0;
    for (const double value : h) {
      largest = std::max(largest, std::abs(value));
    }
    std::size_t first = 0;
    while (first < h.size() && !(std::abs(h[first]) > negligible * largest)) {
      ++first;
    }
    if (first >= h.size() || first >= samples) {
      throw about("impulse_response", ParameterError("impulse_response is zero over the " + std::to_string(samples) +
                                                     " samples of a trial: the input would never act"));
    }
    if (s.relative_degree && m_ != first) {
      throw ParameterError("relative_degree", m_,
                           "impulse_response first acts after " + std::to_string(first) + " samples");
    }
    m_ = first;
  }
  n_ = samples - m_;
  if (!h.empty()) {
    if (n_ > lifted_ceiling) {
      throw about(
          "initial",
          ParameterError("initial has " + std::to_string(samples) + " samples: with an impulse_response at most " +
                         std::to_string(lifted_ceiling) + ", because matrices of that size are built"));
    }
    h_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n_));
    for (std::size_t k = 0; k < n_ && m_ + k < h.size(); ++k) {
      h_[static_cast<Eigen::Index>(k)] = h[m_ + k];
    }
  }
}

void LearningUpdate::resolve_gains(const LearningSettings& s) {
  require_finite(s.k_p, "k_p");
  require_finite(s.k_d, "k_d");
  require_finite(s.learning_function, "learning_function");
  const auto gain = [&](std::optional<double> given, const char* name) {
    if (!given && h_.size() == 0) {
      throw about(name, ParameterError(std::string(name) +
                                       " is missing: give it, or impulse_response for the default 0.5 / h_m"));
    }
    return given ? *given : default_gain / h_[0];
  };
  if (s.law == LearningLaw::d) {
    const double k_d = gain(s.k_d, "k_d");
    taps_ = {k_d, -k_d};
  } else if (s.law == LearningLaw::pd) {
    if (!s.k_d) {
      throw about("k_d", ParameterError("k_d is missing: law 'pd' needs it"));
    }
    const double k_p = gain(s.k_p, "k_p");
    taps_ = {*s.k_d, k_p - *s.k_d};
    lead_ = 1;
  } else if (!s.learning_function.empty()) {
    taps_ = s.learning_function;
    const int lead = s.lead.value_or(0);
    if (!(lead >= 0 && static_cast<std::size_t>(lead) < n_)) {
      throw ParameterError("lead", lead, "must be in 0.." + std::to_string(n_ - 1));
    }
    lead_ = static_cast<std::size_t>(lead);
  } else {
    taps_ = {gain(s.k_p, "k_p")};
  }
  cutoff_ = s.law == LearningLaw::q_filter ? s.cutoff.value_or(default_cutoff) : s.cutoff;
  if (cutoff_) q_.emplace(n_, *cutoff_);
}

void LearningUpdate::resolve_weights(const LearningSettings& s) {
  if (h_.size() == 0) {
    throw about("impulse_response", ParameterError("impulse_response is missing: law 'norm_optimal' needs a model"));
  }
  norm_optimal_ = true;
  const Eigen::MatrixXd g = toeplitz(h_);
  const Eigen::MatrixXd square = g.transpose() * g;
  error_weight_ = s.error_weight.value_or(1.0);
  input_weight_ = s.input_weight.value_or(0.0);
  if (s.change_weight) {
    change_weight_ = *s.change_weight;
  } else {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(square, Eigen::EigenvaluesOnly);
    change_weight_ = default_change * solver.eigenvalues().maxCoeff();
  }
  if (!(error_weight_ > 0.0 && std::isfinite(error_weight_))) {
    throw ParameterError("error_weight", error_weight_, "must be > 0 and finite");
  }
  for (const auto& [name, value] : {std::pair{"input_weight", input_weight_}, {"change_weight", change_weight_}}) {
    if (!(value >= 0.0 && std::isfinite(value))) {
      throw ParameterError(name, value, "must be >= 0 and finite");
    }
  }
  Eigen::MatrixXd normal = error_weight_ * square;
  normal.diagonal().array() += input_weight_ + change_weight_;
  factor_.compute(normal);
  if (factor_.info() != Eigen::Success || !(factor_.rcond() > least_condition)) {
    throw ParameterError("change_weight", change_weight_,
                         "too small for this impulse_response, some inputs hardly act: enlarge it");
  }
  work_.resize(h_.size());
}

void LearningUpdate::apply(std::span<const double> error, std::span<double> input) noexcept {
  if (norm_optimal_) {
    // The printed Q and L in one step: u_{j+1} - u_j = (G^T We G + Wu + Wd)^-1 (We G^T e - Wu u_j).
    for (std::size_t t = 0; t < n_; ++t) {
      double sum = 0.0;
      for (std::size_t k = t; k < n_; ++k) {
        sum += h_[static_cast<Eigen::Index>(k - t)] * error[k];
      }
      work_[static_cast<Eigen::Index>(t)] = error_weight_ * sum - input_weight_ * input[t];
    }
    factor_.solveInPlace(work_);
    for (std::size_t t = 0; t < n_; ++t) {
      input[t] += work_[static_cast<Eigen::Index>(t)];
    }
    return;
  }
  for (std::size_t t = 0; t < n_; ++t) {
    for (std::size_t i = 0; i < taps_.size() && i <= t + lead_; ++i) {
      input[t] += taps_[i] * error[std::min(t + lead_ - i, n_ - 1)];
    }
  }
  filter(input);
}

void LearningUpdate::filter(std::span<double> column) noexcept {
  if (q_) q_->apply(column);
}

}  // namespace mgdd::optimize
