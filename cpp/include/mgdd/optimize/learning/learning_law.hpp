// A law of iterative learning control: how the input of the next trial follows from the last input and its error,
// u_{j+1} = Q (u_j + L e_j). Inputs and errors stand in the units of the caller; frequencies are fractions of Nyquist.
// Source: Bristow, Tharayil and Alleyne (2006), a survey; the D-type is that of Arimoto et al. (1984).
// Building a law throws and allocates; `apply` does neither.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "mgdd/math/zero_phase.hpp"

namespace mgdd::optimize {

enum class LearningLaw {
  p,             ///< L e(t) = k_p e(t+m)
  d,             ///< L e(t) = k_d [e(t+m) - e(t+m-1)]
  pd,            ///< L e(t) = k_p e(t+m) + k_d [e(t+m+1) - e(t+m)]
  q_filter,      ///< L e(t) = sum_i l_i e(t+m+lead-i), and Q a zero-phase low-pass
  norm_optimal,  ///< minimises We |e|^2 + Wu |u|^2 + Wd |u - u_j|^2 on the model
};

/// What a learner is told. A setting that its law would not use is refused.
struct LearningSettings {
  std::vector<double> initial{};  ///< input of trial 0; its length is that of every trial
  LearningLaw law = LearningLaw::p;
  std::vector<double> impulse_response{};   ///< h_0, h_1, ... of the model; empty where none is known
  std::optional<int> relative_degree{};     ///< samples until an input acts; none: of impulse_response, else 0
  std::optional<double> k_p{};              ///< p, pd, q_filter; none: 0.5 / h_m
  std::optional<double> k_d{};              ///< d, pd; none: 0.5 / h_m for d, while pd needs it
  std::vector<double> learning_function{};  ///< q_filter: l_0, l_1, ... instead of k_p
  std::optional<int> lead{};                ///< q_filter: samples that l_0 looks ahead beyond m; none: 0
  std::optional<double> cutoff{};           ///< of Q; none: 0.2 for q_filter, Q = 1 for p, d, pd
  std::optional<double> error_weight{};     ///< norm_optimal: We, none: 1
  std::optional<double> input_weight{};     ///< norm_optimal: Wu, none: 0
  std::optional<double> change_weight{};    ///< norm_optimal: Wd, none: 0.1 sigma_max(G)^2
  double lower = -std::numeric_limits<double>::infinity();  ///< of every input
  double upper = std::numeric_limits<double>::infinity();
  double rate = std::numeric_limits<double>::infinity();  ///< largest change from sample to sample
  bool guard = true;  ///< stop learning when the error norm rises in two trials in a row

  bool operator==(const LearningSettings&) const = default;
};

/// The longest trial for which matrices of the lifted form are built.
inline constexpr std::size_t lifted_ceiling = 1000;

/// Lower-triangular Toeplitz matrix of that size from its first column.
[[nodiscard]] Eigen::MatrixXd toeplitz(const Eigen::VectorXd& column);

/// The settings, checked and resolved, acting on the n = samples - m inputs that a trial can see. Errors before that
/// window count as zero, errors behind it as its last one.
class LearningUpdate {
 public:
  /// Throws ParameterError or ShapeError, naming the field.
  explicit LearningUpdate(const LearningSettings& settings);

  /// u := Q (u + L e), both of length n.
  void apply(std::span<const double> error, std::span<double> input) noexcept;

  /// column := Q column, nothing where Q = 1 and for norm_optimal, whose Q is not a filter.
  void filter(std::span<double> column) noexcept;

  [[nodiscard]] std::size_t samples() const noexcept { return n_; }              ///< n
  [[nodiscard]] std::size_t relative_degree() const noexcept { return m_; }      ///< m
  [[nodiscard]] const Eigen::VectorXd& response() const noexcept { return h_; }  ///< h_m, h_{m+1}, ...; empty: unknown
  [[nodiscard]] const std::vector<double>& taps() const noexcept { return taps_; }
  [[nodiscard]] std::size_t lead() const noexcept { return lead_; }
  [[nodiscard]] std::optional<double> cutoff() const noexcept { return cutoff_; }
  [[nodiscard]] bool is_norm_optimal() const noexcept { return norm_optimal_; }
  [[nodiscard]] double error_weight() const noexcept { return error_weight_; }
  [[nodiscard]] double input_weight() const noexcept { return input_weight_; }
  [[nodiscard]] double change_weight() const noexcept { return change_weight_; }

 private:
  void resolve_model(const LearningSettings& settings);
  void resolve_gains(const LearningSettings& settings);
  void resolve_weights(const LearningSettings& settings);

  std::size_t n_ = 0, m_ = 0, lead_ = 0;
  Eigen::VectorXd h_;
  std::vector<double> taps_;
  std::optional<double> cutoff_;
  std::optional<ZeroPhaseLowPass> q_;
  bool norm_optimal_ = false;
  double error_weight_ = 0.0, input_weight_ = 0.0, change_weight_ = 0.0;
  // Of G^T We G + Wu + Wd; of something, so that a law without it can be moved.
  Eigen::LLT<Eigen::MatrixXd> factor_{Eigen::MatrixXd::Identity(1, 1)};
  Eigen::VectorXd work_;
};

}  // namespace mgdd::optimize
