// Rk4<Ode>: the discrete models of an ODE right-hand side by the classical Runge-Kutta method of order 4, the input
// held over the sample. Units are the model's own, time s. noexcept and heap-free as the right-hand side is.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <tuple>
#include <utility>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::dynamics {

/// Right-hand side of an ODE: `derivative(coefficients, state, input)` [state unit per s] and `output(coefficients,
/// state)`, templates on the scalar, for sizes n_parameters, n_states and n_inputs. The coefficients are the
/// parameters, or what `coefficients(parameters)` makes of them once. What predicts or observes needs them on three
/// scalars of their own: coefficients, state, input.
template <class O>
concept Ode = requires(const O& ode, const Values<Dual<2>, O::n_parameters>& parameters,
                       const Values<Dual<2>, O::n_states>& state, const Values<double, O::n_inputs>& input) {
  requires requires { ode.coefficients(parameters); } || requires {
    { ode.derivative(parameters, state, input) } noexcept -> std::same_as<Values<Dual<2>, O::n_states>>;
    { ode.output(parameters, state) } noexcept -> std::convertible_to<Dual<2>>;
  };
};

namespace detail {

template <class O, class C>
auto ode_coefficients(const O& ode, const Values<C, O::n_parameters>& parameters) noexcept {
  if constexpr (requires { ode.coefficients(parameters); }) {
    return ode.coefficients(parameters);
  } else {
    return parameters;
  }
}

}  // namespace detail

/// Prepared: coefficients C on states of T, the same or plain numbers on duals.
template <class O, class T, class C = T>
struct Rk4Model {
  using Scalar = T;
  using State = Values<T, O::n_states>;
  using Input = Values<double, O::n_inputs>;
  using Plain = typename PlainScalar<T>::type;
  using Coefficients =
      decltype(detail::ode_coefficients(std::declval<const O&>(), std::declval<const Values<C, O::n_parameters>&>()));
  static constexpr int n_observed = O::n_states;

  O ode;
  Coefficients coefficients;
  double sample = 1e-3;
  int substeps = 1;

  /// `input` may carry derivatives too.
  template <class U>
  MGDD_INLINE void step(State& state, const Values<U, O::n_inputs>& input) const noexcept {
    const double h = sample / substeps;
    for (int k = 0; k < substeps; ++k) {
      const State k1 = ode.derivative(coefficients, state, input);
      const State k2 = ode.derivative(coefficients, along(state, 0.5 * h, k1), input);
      const State k3 = ode.derivative(coefficients, along(state, 0.5 * h, k2), input);
      const State k4 = ode.derivative(coefficients, along(state, h, k3), input);
      const Plain two = Plain(2.0);
      const Plain sixth = Plain(h / 6.0);
      for (std::size_t i = 0; i < state.size(); ++i)
        state[i] += sixth * (k1[i] + two * (k2[i] + k3[i]) + k4[i]);
    }
  }
  MGDD_INLINE T output(const State& state) const noexcept { return T(ode.output(coefficients, state)); }
  double sample_s() const noexcept { return sample; }

  template <class U>
  Rk4Model<O, U, C> over() const noexcept {
    return {ode, coefficients, sample, substeps};
  }
  template <class S>
  static auto numbers(S& state) noexcept {
    return std::apply([](auto&... x) { return std::array{&x...}; }, state);
  }

 private:
  MGDD_INLINE static State along(State state, double h, const State& slope) noexcept {
    const Plain length = Plain(h);
    for (std::size_t i = 0; i < state.size(); ++i)
      state[i] += length * slope[i];
    return state;
  }
};

/// The family. A start is the whole state.
template <Ode O>
struct Rk4 {
  static constexpr int n_parameters = O::n_parameters;
  static constexpr int n_start = O::n_states;

  O ode{};
  int substeps = 1;

  template <class T>
  Rk4Model<O, T> prepare(const Values<T, n_parameters>& parameters, double sample_s) const noexcept {
    return {ode, detail::ode_coefficients(ode, parameters), sample_s, substeps};
  }
  template <class T, class Model>
  Values<T, n_start> start(const Model&, const Values<T, n_start>& stated) const noexcept {
    return stated;
  }
};

}  // namespace mgdd::dynamics
