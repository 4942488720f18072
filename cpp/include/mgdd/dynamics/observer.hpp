// An observer of a discrete model of one input: prediction by the duty that acted, then a correction by the measurement
// with the model's own fixed gains. A measurement that is not finite corrects nothing. `update` is noexcept and
// heap-free; the state is saved and restored bit for bit.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <string>

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
