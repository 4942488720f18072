// Wiener-Hammerstein model: linear filter, static curve, linear filter; and its output-error residual with exact
// derivatives. Sampled signals; the unit of the input and of the output are the caller's, both filters have gain 1 at
// rest, so that the curve between them carries the unit and no gain is counted twice.
// Structure and derivatives: Schoukens, Pintelon and Rolain 2014 (block-oriented, started from linear approximations);
// the curve is a uniform cubic B-spline. Desk-time: allocates; the residual call is noexcept.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "mgdd/dynamics/discrete_model.hpp"
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

/// A static curve with its coefficients.
struct CurveTable {
  struct Point {
    double value, slope;
  };
  WienerHammerstein model;
  Eigen::VectorXd coefficients;

  [[nodiscard]] Point at(double x) const noexcept;
};

/// The model as it runs, sample by sample: both filters and the present output are the state, which starts at rest.
/// What the input does within its own sample shows in the output after the step. Coefficients are plain numbers.
template <class T>
class WienerHammersteinModel {
 public:
  static constexpr int order_ceiling = 10;
  using Scalar = T;
  using Input = T;
  struct State {
    T output{0.0};
    std::array<T, order_ceiling> first{}, last{};
  };
  static constexpr int n_observed = 1;

  /// ParameterError or ShapeError for what `model` and its numbers cannot be.
  WienerHammersteinModel(const WienerHammerstein& model, const Eigen::VectorXd& parameters);

  void step(State& s, const T& input) const noexcept {
    s.output = filtered(last_b_, last_a_, s.last, curve(filtered(first_b_, first_a_, s.first, input)));
  }
  T output(const State& s) const noexcept { return s.output; }
  double sample_s() const noexcept { return 1.0; }  ///< the model knows samples, not seconds
  State at_rest(const T& output) const noexcept { return {output, {}, {}}; }

  template <class U>
  WienerHammersteinModel<U> over() const noexcept {
    return WienerHammersteinModel<U>(*this);
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::apply(
        [&](auto&... first) {
          return std::apply([&](auto&... last) { return std::array{&s.output, &first..., &last...}; }, s.last);
        },
        s.first);
  }

 private:
  using Coefficients = std::array<double, order_ceiling + 1>;
  template <class>
  friend class WienerHammersteinModel;
  template <class V>
  explicit WienerHammersteinModel(const WienerHammersteinModel<V>& o) noexcept
      : first_b_(o.first_b_), first_a_(o.first_a_), last_b_(o.last_b_), last_a_(o.last_a_), curve_(o.curve_) {}

  static T filtered(const Coefficients& b, const Coefficients& a, std::array<T, order_ceiling>& s,
                    const T& in) noexcept {
    const T out = T(b[0]) * in + s[0];
    for (std::size_t i = 1; i < s.size(); ++i)
      s[i - 1] = T(b[i]) * in - T(a[i]) * out + s[i];
    s.back() = T(b.back()) * in - T(a.back()) * out;
    return out;
  }
  T curve(const T& x) const noexcept {
    if constexpr (is_dual_v<T>) {
      using S = typename T::Scalar;
      const auto [value, slope] = curve_->at(static_cast<double>(x.value));
      return chain(static_cast<S>(value), static_cast<S>(slope), x);
    } else {
      return each(x, [this](auto v) { return static_cast<decltype(v)>(curve_->at(static_cast<double>(v)).value); });
    }
  }

  Coefficients first_b_{}, first_a_{}, last_b_{}, last_a_{};
  std::shared_ptr<const CurveTable> curve_;  // shared by copies: a model is copied without the heap
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
