// Linear discrete model of one input and one output, x(k+1) = A x + b u, y = c'x, of an order told at run time, at most
// `most_states`. Units are the model's own, time s. `step` and `output` are noexcept and heap-free; made offline.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::dynamics {

/// Of a model whose order is told at run time: its numbers fill the front of the state.
inline constexpr std::size_t most_states = 32;
using RunTimeState = std::array<double, most_states>;

inline auto places_of(RunTimeState& x) noexcept {
  std::array<double*, most_states> out{};
  for (std::size_t i = 0; i < most_states; ++i)
    out[i] = &x[i];
  return out;
}
inline auto places_of(const RunTimeState& x) noexcept {
  std::array<const double*, most_states> out{};
  for (std::size_t i = 0; i < most_states; ++i)
    out[i] = &x[i];
  return out;
}

inline void pull_toward(RunTimeState& x, double innovation, const RunTimeState& gain) noexcept {
  for (std::size_t i = 0; i < most_states; ++i)
    x[i] += gain[i] * innovation;
}

class LinearModel {
 public:
  using Scalar = double;
  using State = RunTimeState;
  using Input = double;
  static constexpr int n_observed = static_cast<int>(most_states);

  /// ShapeError for matrices that do not fit, ParameterError for numbers that are not finite.
  LinearModel(Eigen::MatrixXd a, Eigen::VectorXd b, Eigen::VectorXd c, double sample_s)
      : a_(std::move(a)), b_(std::move(b)), c_(std::move(c)), sample_s_(sample_s) {
    const Eigen::Index n = a_.rows();
    if (n < 1 || n > static_cast<Eigen::Index>(most_states) || a_.cols() != n) {
      throw ShapeError("a has shape (" + std::to_string(n) + ", " + std::to_string(a_.cols()) +
                       "): must be square, with 1 to " + std::to_string(most_states) + " states");
    }
    require("b", b_, n);
    require("c", c_, n);
    if (!a_.allFinite()) throw ParameterError("a holds a number that is not finite");
    require_positive("sample_s", sample_s);
  }

  void step(State& state, double input) const noexcept {
    const State now = state;
    for (Eigen::Index i = 0; i < order(); ++i) {
      double next = b_(i) * input;
      for (Eigen::Index j = 0; j < order(); ++j)
        next += a_(i, j) * now[static_cast<std::size_t>(j)];
      state[static_cast<std::size_t>(i)] = next;
    }
  }
  double output(const State& state) const noexcept {
    return c_.dot(Eigen::Map<const Eigen::VectorXd>(state.data(), order()));
  }
  double sample_s() const noexcept { return sample_s_; }
  Eigen::Index order() const noexcept { return a_.rows(); }
  void linearise(const State&, double, Eigen::MatrixXd& a, Eigen::VectorXd& b) const noexcept {
    a = a_;
    b = b_;
  }
  /// Pulls the state toward a measured output: x += gain (y - c'x).
  void correct(State& state, double measured, const RunTimeState& gain) const noexcept {
    pull_toward(state, measured - output(state), gain);
  }
  void output_slope(const State&, Eigen::VectorXd& c) const noexcept { c = c_; }
  template <class S>
  static auto numbers(S& state) noexcept {
    return places_of(state);
  }

 private:
  static void require(const char* name, const Eigen::VectorXd& column, Eigen::Index n) {
    if (column.size() != n) {
      throw ShapeError(std::string(name) + " has " + std::to_string(column.size()) + " numbers: must have " +
                       std::to_string(n) + ", one per state");
    }
    if (!column.allFinite()) throw ParameterError(std::string(name) + " holds a number that is not finite");
  }

  Eigen::MatrixXd a_;
  Eigen::VectorXd b_, c_;
  double sample_s_;
};

}  // namespace mgdd::dynamics
