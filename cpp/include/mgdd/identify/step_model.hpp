// What the output-error fit calls a model: a discrete step with an output, templated on the scalar so that duals run
// through it; and Rk4, which makes one of an ODE right-hand side. Units are the model's own; time in s.
// `step` and `output` promise noexcept and no heap (Griewank and Walther 2008, chapter 3, for the duals).
#pragma once

#include <array>
#include <concepts>
#include <cstddef>

namespace mgdd::identify {

template <class T, int n>
using Values = std::array<T, static_cast<std::size_t>(n)>;

/// Discrete model of one output: state(k+1) = step(parameters, state(k), input(k), dt), y(k) = output(parameters,
/// state(k), input(k)). The input is held over the sample. Sizes are compile-time: `n_states`, `n_inputs`,
/// `n_parameters`.
template <class M>
concept StepModel =
    requires(const M& model, const Values<double, M::n_parameters>& parameters,
             const Values<double, M::n_states>& state, const Values<double, M::n_inputs>& input, double dt_s) {
      {
        model.template step<double>(parameters, state, input, dt_s)
      } noexcept -> std::same_as<Values<double, M::n_states>>;
      { model.template output<double>(parameters, state, input) } noexcept -> std::same_as<double>;
    };

/// A model that computes its start itself, from the parameters and the start stated in the record (a current that
/// holds the first angle, say): `start<T>(parameters, stated) noexcept`.
template <class M>
concept HasStart = requires(const M& model, const Values<double, M::n_parameters>& parameters,
                            const Values<double, M::n_states>& stated) {
  { model.template start<double>(parameters, stated) } noexcept -> std::same_as<Values<double, M::n_states>>;
};

/// Right-hand side of an ODE: `derivative<T>(parameters, state, input)` [state unit per s] and `output<T>`.
template <class O>
concept Ode = requires(const O& ode, const Values<double, O::n_parameters>& parameters,
                       const Values<double, O::n_states>& state, const Values<double, O::n_inputs>& input) {
  { ode.template derivative<double>(parameters, state, input) } noexcept -> std::same_as<Values<double, O::n_states>>;
  { ode.template output<double>(parameters, state, input) } noexcept -> std::same_as<double>;
};

/// Classical Runge-Kutta of order 4 with the input held, `substeps` equal steps per sample.
template <Ode O>
struct Rk4 {
  static constexpr int n_states = O::n_states;
  static constexpr int n_inputs = O::n_inputs;
  static constexpr int n_parameters = O::n_parameters;

  O ode{};
  int substeps = 1;

  template <class T>
  Values<T, n_states> step(const Values<T, n_parameters>& parameters, Values<T, n_states> state,
                           const Values<double, n_inputs>& input, double dt_s) const noexcept {
    const double h = dt_s / substeps;
    for (int k = 0; k < substeps; ++k) {
      const auto k1 = ode.template derivative<T>(parameters, state, input);
      const auto k2 = ode.template derivative<T>(parameters, along<T>(state, 0.5 * h, k1), input);
      const auto k3 = ode.template derivative<T>(parameters, along<T>(state, 0.5 * h, k2), input);
      const auto k4 = ode.template derivative<T>(parameters, along<T>(state, h, k3), input);
      for (std::size_t i = 0; i < state.size(); ++i)
        state[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
    return state;
  }

  template <class T>
  T output(const Values<T, n_parameters>& parameters, const Values<T, n_states>& state,
           const Values<double, n_inputs>& input) const noexcept {
    return ode.template output<T>(parameters, state, input);
  }

  template <class T>
  Values<T, n_states> start(const Values<T, n_parameters>& parameters, const Values<T, n_states>& stated) const noexcept
    requires HasStart<O>
  {
    return ode.template start<T>(parameters, stated);
  }

 private:
  template <class T>
  static Values<T, n_states> along(Values<T, n_states> state, double h, const Values<T, n_states>& slope) noexcept {
    for (std::size_t i = 0; i < state.size(); ++i)
      state[i] += h * slope[i];
    return state;
  }
};

}  // namespace mgdd::identify
