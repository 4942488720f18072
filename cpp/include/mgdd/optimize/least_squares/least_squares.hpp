// Dense Levenberg-Marquardt with bounds and log-scaled parameters: numbers in, numbers out.
// Minimises sum r(x)^2 / 2. Parameters, residual and Jacobian stand in the caller's units; scaling happens
// inside. `iterate()` allocates nothing and throws nothing of its own unless the model changes the size of
// its outputs.
#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/parameter.hpp"

namespace mgdd::optimize {

/// Levenberg-Marquardt (Moré 1978 for the column scaling, Nielsen 1999 for the damping). A step that leaves
/// the box is clipped and the remaining parameters are solved again; a parameter at a bound whose descent
/// points outward is held.
///
/// `model(x, residual, jacobian)` with `bool operator()(const VectorXd&, VectorXd&, MatrixXd*)` fills the
/// residual and, when the pointer is not null, the Jacobian d residual / d x. False or a value that is not
/// finite says that this point cannot be evaluated: the step is refused and the damping grows. One object
/// serves many fits of one shape.
class LeastSquares {
 public:
  LeastSquares(std::vector<Parameter> parameters, Eigen::Index n_residuals, LeastSquaresOptions options = {});

  /// prepare, iterate until it says stop, report. A refused start throws and leaves the object as it was.
  template <class Model>
  [[nodiscard]] FitReport solve(Model&& model, const Eigen::VectorXd& start) {
    prepare(start);
    while (iterate(model)) {
    }
    return report();
  }

  /// Checks and stores the start. The only part besides the constructor and report() that may allocate.
  void prepare(const Eigen::VectorXd& start);

  /// The first call evaluates the start, every further one tries one step. False when the search has ended.
  template <class Model>
  bool iterate(Model&& model) {
    if (is_stopped()) return false;
    if (phase_ == Phase::start) {
      begin(evaluate(model, x_, residual_, &jacobian_));
    } else if (phase_ == Phase::search) {
      propose();
      Eigen::MatrixXd* together = options_.evaluate_together ? &trial_jacobian_ : nullptr;
      bool accepted = judge(evaluate(model, trial_x_, trial_residual_, together));
      if (accepted && together == nullptr) {
        --nfev_;
        accepted = evaluate(model, trial_x_, trial_residual_, &trial_jacobian_);
      }
      settle(accepted);
    }
    return phase_ == Phase::search;
  }

  /// The same search with the evaluation outside, for callers that evaluate many searches side by side: `ask()` is the
  /// point to evaluate next, `tell()` takes residual and Jacobian there and returns false when the search has ended.
  /// Always one `tell()` per `ask()`, after `prepare()`.
  [[nodiscard]] const Eigen::VectorXd& ask() noexcept {
    if (phase_ == Phase::start) return x_;
    if (phase_ == Phase::search) propose();
    return trial_x_;
  }
  bool tell(bool usable, const Eigen::VectorXd& residual, const Eigen::MatrixXd& jacobian) {
    const auto given = [&](const Eigen::VectorXd&, Eigen::VectorXd& r, Eigen::MatrixXd* j) {
      r = residual;
      *j = jacobian;
      return usable;
    };
    if (phase_ == Phase::start) {
      begin(evaluate(given, x_, residual_, &jacobian_));
    } else if (phase_ == Phase::search) {
      settle(judge(evaluate(given, trial_x_, trial_residual_, &trial_jacobian_)));
    }
    return !is_stopped() && phase_ == Phase::search;
  }

  /// State of the search, by value. Between iterations the status reads iteration_limit: stopped by the
  /// caller.
  [[nodiscard]] FitReport report() const;

  /// d residual / d parameter at the point of the report, in the caller's units.
  [[nodiscard]] const Eigen::MatrixXd& jacobian() const noexcept { return jacobian_; }
  [[nodiscard]] const std::vector<Parameter>& parameters() const noexcept { return parameters_; }
  [[nodiscard]] const LeastSquaresOptions& options() const noexcept { return options_; }
  [[nodiscard]] Eigen::Index n_residuals() const noexcept { return n_residuals_; }

 private:
  enum class Phase { idle, start, search, done };

  template <class Model>
  bool evaluate(Model&& model, const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    ++nfev_;
    njev_ += jacobian != nullptr ? 1 : 0;
    const bool returned = model(x, residual, jacobian);
    return is_usable(returned, residual, jacobian);
  }

  bool is_usable(bool returned, const Eigen::VectorXd& residual, const Eigen::MatrixXd* jacobian) const;
  void begin(bool usable) noexcept;
  void propose() noexcept;
  bool judge(bool usable) noexcept;
  void settle(bool accepted) noexcept;
  void factorise() noexcept;
  void solve_damped() noexcept;
  bool clip_to_box() noexcept;
  bool is_stationary() noexcept;
  bool is_stopped() noexcept;
  void finish(FitStatus status) noexcept;

  std::vector<Parameter> parameters_;
  LeastSquaresOptions options_;
  Eigen::Index n_;
  Eigen::Index n_residuals_;
  Eigen::VectorXd lower_, upper_;  // bounds in search space: natural or log
  Eigen::VectorXd x_, trial_x_;    // natural
  Eigen::VectorXd z_, trial_z_;    // search space
  Eigen::VectorXd residual_, trial_residual_;
  Eigen::MatrixXd jacobian_, trial_jacobian_;
  Eigen::VectorXd chain_;            // dx/dz
  Eigen::VectorXd magnitude_;        // size of a step of 100 % in z
  Eigen::VectorXd column_norm_;      // of d residual / dz
  Eigen::VectorXd largest_norm_;     // since the start (Moré)
  Eigen::VectorXd scale_;            // largest_norm_, 1 where a column is zero so far
  Eigen::VectorXd step_;             // scale * (trial_z - z)
  Eigen::VectorXd image_;            // triangle * step
  Eigen::VectorXi side_;             // -1, +1: held at or clipped to that bound in this step
  Eigen::MatrixXd triangle_, rows_;  // of [J / scale, residual]
  Eigen::MatrixXd step_triangle_, step_rows_;
  std::vector<FitStep> history_;
  Phase phase_ = Phase::idle;
  FitStatus status_ = FitStatus::not_run;
  double cost_ = 0.0;
  double damping_ = 0.0;
  double growth_ = 2.0;
  double predicted_ = 0.0;
  double actual_ = 0.0;
  double gain_ = 0.0;
  double cosine_ = 0.0;
  int nfev_ = 0;
  int njev_ = 0;
  int iterations_ = 0;
};

}  // namespace mgdd::optimize
