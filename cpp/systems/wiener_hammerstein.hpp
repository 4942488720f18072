// Wiener-Hammerstein model: linear filter, static curve, linear filter; and its output-error residual with exact
// derivatives. Sampled signals; the unit of the input and of the output are the caller's, both filters have gain 1 at
// rest, so that the curve between them carries the unit and no gain is counted twice.
// Structure and derivatives: Schoukens, Pintelon and Rolain 2014 (block-oriented, started from linear approximations);
// the curve is a uniform cubic B-spline. Desk-time: allocates; the residual call is noexcept.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::systems {

/// y = B(q)/A(q) u from rest, direct form II transposed; `a[0]` must be 1, orders are arbitrary.
[[nodiscard]] Eigen::VectorXd filter_series(const Eigen::VectorXd& b, const Eigen::VectorXd& a,
                                            const Eigen::VectorXd& u);

/// Whether all roots of A lie inside the unit circle (Schur-Cohn, by the step-down recursion).
[[nodiscard]] bool is_stable(const Eigen::VectorXd& a) noexcept;

/// Orders of the filters and the grid of the curve: coefficients at equal steps of `lower` to `upper`, linear beyond.
struct WienerHammerstein {
  int first_order = 3;
  int last_order = 4;
  int n_curve = 20;
  double lower = -1.0;
  double upper = 1.0;

  /// Throws ParameterError naming the field.
  void validate() const;

  /// a1..an and b0..b(n-1) of the first filter, the same of the last, then the coefficients of the curve. The last
  /// numerator coefficient follows from gain 1 at rest.
  [[nodiscard]] std::vector<std::string> names() const;
  [[nodiscard]] Eigen::Index n_parameters() const noexcept {
    return 2 * static_cast<Eigen::Index>(first_order + last_order) + n_curve;
  }

  /// Response to `input` from rest.
  [[nodiscard]] Eigen::VectorXd simulate(const Eigen::VectorXd& parameters, const Eigen::VectorXd& input) const;
  /// The curve at `x`.
  [[nodiscard]] Eigen::VectorXd curve(const Eigen::VectorXd& parameters, const Eigen::VectorXd& x) const;

  bool operator==(const WienerHammerstein&) const = default;
};

/// The first `skip` samples are left out: the filters start from rest, the record did not.
class WienerHammersteinResidual {
 public:
  WienerHammersteinResidual(const WienerHammerstein& model, Eigen::VectorXd input, Eigen::VectorXd output,
                            Eigen::Index skip);

  /// False for a filter that is not stable.
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) noexcept;

  [[nodiscard]] Eigen::Index n_residuals() const noexcept { return input_.size() - skip_; }

 private:
  WienerHammerstein model_;
  Eigen::VectorXd input_, output_;
  Eigen::Index skip_;
  Eigen::VectorXd between_, curved_, slope_, all_pole_, work_, work_out_, model_out_;  // reused by every call
  Eigen::MatrixXd weights_;                                                            // 4 per sample
  std::vector<Eigen::Index> cell_;
};

[[nodiscard]] optimize::FitReport fit_wiener_hammerstein(const WienerHammerstein& model, const Eigen::VectorXd& start,
                                                         const Eigen::VectorXd& input, const Eigen::VectorXd& output,
                                                         Eigen::Index skip,
                                                         const optimize::LeastSquaresOptions& options);

}  // namespace mgdd::systems
