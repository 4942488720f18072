// Observers of a discrete model of one input: prediction by the duty that acted, then a correction by the measurement,
// with the model's own fixed gains or by an extended Kalman filter with exact Jacobians. A measurement that is not
// finite corrects nothing. `update` is noexcept and heap-free; the state is saved and restored bit for bit.
// Source of the filter: Jazwinski 1970, chapter 8; covariance in Joseph's form (Bucy and Joseph 1968).
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <span>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::dynamics {

/// Every number of a state by name: on duals with its derivatives, `name_0` and on.
template <class M, class State, class V>
void visit_numbers(State& state, V& v) {
  const auto places = M::numbers(state);
  for (std::size_t i = 0; i < places.size(); ++i) {
    std::string name = "state_" + std::to_string(i);
    if constexpr (requires { M::number_names; }) name = M::number_names[i];
    if constexpr (is_dual_v<typename M::Scalar>) {
      v(name, places[i]->value);
      for (std::size_t j = 0; j < places[i]->grad.size(); ++j)
        v(name + "_" + std::to_string(j), places[i]->grad[j]);
    } else {
      v(name, *places[i]);
    }
  }
}

/// Fixed gains: `model.correct(state, measured, gains)`.
template <DiscreteModel M, class Gains>
class FixedGainObserver {
 public:
  using Scalar = typename M::Scalar;
  using State = typename M::State;

  FixedGainObserver(const M& model, const Gains& gains) : model_(model), gains_(gains) { gains_.validate(); }

  void start(const State& state) noexcept { state_ = state; }

  /// One sample: `input` was sent at the sample before this measurement. Gives measured minus predicted output.
  Scalar update(const Scalar& input, const Scalar& measured) noexcept {
    model_.step(state_, input_of(model_, input));
    const Scalar innovation = measured - model_.output(state_);
    if (std::isfinite(value_of(measured))) model_.correct(state_, measured, gains_);
    return innovation;
  }
  /// Other numbers, the same state.
  void set_model(const M& model) noexcept { model_ = model; }

  const State& state() const noexcept { return state_; }
  const M& model() const noexcept { return model_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    visit_numbers<M>(self.state_, v);
  }

 private:
  M model_;
  Gains gains_;
  State state_{};
};

/// Variances per sample, in squared units of the numbers of the state and of the output.
template <class S, int n>
struct KalmanSettings {
  std::array<S, static_cast<std::size_t>(n)> process{};
  std::array<S, static_cast<std::size_t>(n)> start{};
  S measurement = S(1);

  /// ParameterError naming field, value and bound.
  void validate() const {
    for (std::size_t i = 0; i < process.size(); ++i) {
      require_within("process[" + std::to_string(i) + "]", static_cast<double>(process[i]), 0.0, 1e30);
      require_within("start[" + std::to_string(i) + "]", static_cast<double>(start[i]), 0.0, 1e30);
    }
    require_positive("measurement", static_cast<double>(measurement));
  }
};

/// Extended Kalman filter over the first `n_observed` numbers; the others follow from the inputs and are known.
template <DiscreteModel M>
  requires std::floating_point<typename M::Scalar>
class KalmanObserver {
 public:
  static constexpr int n = M::n_observed;
  using Scalar = typename M::Scalar;
  using State = typename M::State;
  using Settings = KalmanSettings<Scalar, n>;
  using Column = std::array<Scalar, static_cast<std::size_t>(n)>;
  using Square = std::array<Column, static_cast<std::size_t>(n)>;

  KalmanObserver(const M& model, const Settings& settings)
      : model_(model), jacobian_model_(model.template over<D>()), settings_(settings) {
    settings_.validate();
    start({});
  }

  void start(const State& state) noexcept {
    state_ = state;
    covariance_ = {};
    for (std::size_t i = 0; i < size; ++i)
      covariance_[i][i] = settings_.start[i];
  }

  /// One sample: `input` was sent at the sample before this measurement. Gives measured minus predicted output.
  Scalar update(Scalar input, Scalar measured) noexcept {
    auto dual = lifted<Lifted>(state_);
    const auto seeds = Lifted::numbers(dual);
    for (std::size_t i = 0; i < size; ++i)
      seeds[i]->grad[i] = Scalar(1);
    jacobian_model_.step(dual, input_of(jacobian_model_, input));
    Square f{};
    for (std::size_t i = 0; i < size; ++i)
      f[i] = seeds[i]->grad;
    model_.step(state_, input_of(model_, input));
    covariance_ = plus_diagonal(between(f, covariance_), settings_.process);
    const Scalar innovation = measured - model_.output(state_);
    gain_ = {};
    if (std::isfinite(measured)) correct(innovation, measured);
    return innovation;
  }

  /// Of the last update; zero where nothing was measured.
  const Column& gain() const noexcept { return gain_; }
  const Square& covariance() const noexcept { return covariance_; }
  /// Variance of the innovation of the last correction.
  Scalar innovation_variance() const noexcept { return innovation_variance_; }
  const State& state() const noexcept { return state_; }
  const M& model() const noexcept { return model_; }
  /// Other numbers, the same state.
  void set_model(const M& model) noexcept {
    model_ = model;
    jacobian_model_ = model.template over<D>();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    visit_numbers<M>(self.state_, v);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j)
        v("covariance_" + std::to_string(i) + "_" + std::to_string(j), self.covariance_[i][j]);
    }
  }

 private:
  static constexpr std::size_t size = static_cast<std::size_t>(n);
  using D = Dual<n, Scalar>;
  using Lifted = decltype(std::declval<const M&>().template over<D>());

  void correct(Scalar innovation, Scalar measured) noexcept {
    auto dual = lifted<Lifted>(state_);
    const auto seeds = Lifted::numbers(dual);
    for (std::size_t i = 0; i < size; ++i)
      seeds[i]->grad[i] = Scalar(1);
    const Column h = jacobian_model_.output(dual).grad;
    Column ph{};
    innovation_variance_ = settings_.measurement;
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j)
        ph[i] += covariance_[i][j] * h[j];
      innovation_variance_ += h[i] * ph[i];
    }
    const auto numbers = M::numbers(state_);
    Square keep{};  // I - K H
    for (std::size_t i = 0; i < size; ++i) {
      gain_[i] = ph[i] / innovation_variance_;
      *numbers[i] += gain_[i] * innovation;
      for (std::size_t j = 0; j < size; ++j)
        keep[i][j] = (i == j ? Scalar(1) : Scalar(0)) - gain_[i] * h[j];
    }
    covariance_ = between(keep, covariance_);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j)
        covariance_[i][j] += gain_[i] * settings_.measurement * gain_[j];
    }
    if constexpr (requires { model_.confine(state_); }) model_.confine(state_);
    if constexpr (requires { model_.see(state_, measured); }) model_.see(state_, measured);
  }

  /// A P A'
  static Square between(const Square& a, const Square& p) noexcept {
    Square ap{}, out{};
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        for (std::size_t k = 0; k < size; ++k)
          ap[i][j] += a[i][k] * p[k][j];
      }
    }
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        for (std::size_t k = 0; k < size; ++k)
          out[i][j] += ap[i][k] * a[j][k];
        out[j][i] = out[i][j];
      }
    }
    return out;
  }
  static Square plus_diagonal(Square p, const Column& d) noexcept {
    for (std::size_t i = 0; i < size; ++i)
      p[i][i] += d[i];
    return p;
  }

  M model_;
  Lifted jacobian_model_;
  Settings settings_;
  State state_{};
  Square covariance_{};
  Column gain_{};
  Scalar innovation_variance_{};
};

/// What an observer with fixed gains would have told: entry k is the output `horizon` samples after sample k, from the
/// state corrected by the measurements up to k. `state` is that at the first sample, before its correction; as many
/// entries as inputs less `horizon`.
template <DiscreteModel M, class Gains>
void predict_ahead(const M& model, typename M::State state, const Gains& gains, std::size_t horizon,
                   std::span<const typename M::Scalar> input, std::span<const typename M::Scalar> measured,
                   std::span<typename M::Scalar> output) noexcept {
  for (std::size_t k = 0; k + horizon < input.size(); ++k) {
    model.correct(state, measured[k], gains);
    auto ahead = state;
    for (std::size_t j = 0; j < horizon; ++j)
      model.step(ahead, input_of(model, input[k + j]));
    output[k] = model.output(ahead);
    model.step(state, input_of(model, input[k]));
  }
}

}  // namespace mgdd::dynamics
