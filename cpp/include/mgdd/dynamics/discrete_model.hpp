// What every model of a sampled system fulfils, whatever its plant: `DiscreteModel`, prepared numbers that step a state
// by one sample, and `ModelFamily`, which prepares one from parameters on any scalar. Units are the model's own, time
// s. `step`, `output` and `prepare` are noexcept and heap-free. Scalars: double, float, Dual<N> for exact derivatives
// (Griewank and Walther 2008, chapter 3), Lanes<N> for many runs.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <tuple>
#include <type_traits>

#include "mgdd/common/record.hpp"
#include "mgdd/math/select.hpp"

namespace mgdd::dynamics {

template <class T, int n>
using Values = std::array<T, static_cast<std::size_t>(n)>;

/// A prepared model: y(k) = output(state(k)), state(k+1) = step(state(k), input(k)), the input held over the sample.
/// What the input does later (a delay) is part of the state. `numbers` gives every number of a state, so that an
/// observer, a sensitivity or a restart can address them: the first `n_observed` are those that an observer may correct
/// (position, speed, bias ...), the others follow from the inputs.
template <class M>
concept DiscreteModel =
    std::is_trivially_copyable_v<typename M::State> && std::copyable<M> &&
    requires(const M& model, typename M::State& state, const typename M::State& seen, const typename M::Input& input) {
      typename M::Scalar;
      { model.step(state, input) } noexcept -> std::same_as<void>;
      { model.output(seen) } noexcept -> std::same_as<typename M::Scalar>;
      { model.sample_s() } noexcept -> std::convertible_to<double>;
      { M::numbers(state)[0] } noexcept -> std::convertible_to<typename M::Scalar*>;
      { M::numbers(seen)[0] } noexcept -> std::convertible_to<const typename M::Scalar*>;
      { std::integral_constant<int, M::n_observed>{} };
    };

/// A model that has a state at rest with a given output.
template <class M>
concept StartsAtRest = DiscreteModel<M> && requires(const M& model, const typename M::Scalar& output) {
  { model.at_rest(output) } noexcept -> std::same_as<typename M::State>;
};

/// A model whose coefficients can work on states of another scalar: `over<U>()`, with U at least as wide.
template <class M, class U>
concept Liftable = DiscreteModel<M> && requires(const M& model) {
  { model.template over<U>() } noexcept -> DiscreteModel;
};

template <class M>
inline constexpr std::size_t n_numbers = std::tuple_size_v<decltype(M::numbers(std::declval<typename M::State&>()))>;

/// The input of a model of one input from a number: a scalar, an array of one, or what `model.input` makes of it. A
/// number that an array of the model cannot hold (a dual) goes in an array of its own, where the model steps by that.
template <class M, class U>
MGDD_INLINE constexpr auto input_of(const M& model, const U& value) noexcept {
  using Input = typename M::Input;
  if constexpr (requires { model.input(typename M::Scalar(value)); }) {
    return model.input(typename M::Scalar(value));
  } else if constexpr (requires { typename Input::value_type; }) {
    if constexpr (is_dual_v<U> && !is_dual_v<typename Input::value_type>) {
      return std::array<U, 1>{value};
    } else {
      return Input{static_cast<typename Input::value_type>(value)};
    }
  } else {
    return static_cast<Input>(value);
  }
}

/// The same state with another scalar, derivatives zero.
template <class To, class From>
typename To::State lifted(const From& from) noexcept {
  typename To::State to{};
  const auto targets = To::numbers(to);
  const auto sources = To::numbers(from);
  for (std::size_t i = 0; i < targets.size(); ++i)
    *targets[i] = typename To::Scalar(*sources[i]);
  return to;
}

/// Structural options that make a model of `n_parameters` numbers for a sample time, and a start from `n_start` stated
/// numbers (a measured angle, or a whole state).
template <class F>
concept ModelFamily = requires(const F& family, const Values<double, F::n_parameters>& parameters,
                               const Values<double, F::n_start>& stated) {
  { family.template prepare<double>(parameters, 1e-3) } noexcept -> DiscreteModel;
  {
    family.template start<double>(family.template prepare<double>(parameters, 1e-3), stated)
  } noexcept -> std::same_as<typename decltype(family.template prepare<double>(parameters, 1e-3))::State>;
};

/// A family with tables of its numbers.
template <class F>
concept DescribedFamily = ModelFamily<F> && requires {
  { F::parameters[0] } -> std::convertible_to<const FieldInfo&>;
  { F::start_numbers[0] } -> std::convertible_to<const FieldInfo&>;
};

template <class F, class T>
using FamilyModel =
    decltype(std::declval<const F&>().template prepare<T>(std::declval<const Values<T, F::n_parameters>&>(), 1e-3));

/// Whether a family's models fulfil the contract on every scalar.
template <class F>
inline constexpr bool on_every_scalar =
    DiscreteModel<FamilyModel<F, double>> && DiscreteModel<FamilyModel<F, float>> &&
    DiscreteModel<FamilyModel<F, Dual<3>>> && DiscreteModel<FamilyModel<F, Dual<3, float>>> &&
    DiscreteModel<FamilyModel<F, Lanes<8>>>;

/// A model stepped `steps` times per sample under a held input: a plant with a fine step seen at a coarse one.
template <DiscreteModel M>
struct Repeated {
  using Scalar = typename M::Scalar;
  using State = typename M::State;
  using Input = typename M::Input;
  static constexpr int n_observed = M::n_observed;

  M model;
  int steps = 1;

  MGDD_INLINE void step(State& state, const Input& input) const noexcept {
    for (int i = 0; i < steps; ++i)
      model.step(state, input);
  }
  Scalar output(const State& state) const noexcept { return model.output(state); }
  double sample_s() const noexcept { return steps * model.sample_s(); }
  Input input(const Scalar& value) const noexcept { return input_of(model, value); }
  template <class U>
  auto over() const noexcept {
    return Repeated<decltype(model.template over<U>())>{model.template over<U>(), steps};
  }
  template <class S>
  static auto numbers(S& state) noexcept {
    return M::numbers(state);
  }
};

}  // namespace mgdd::dynamics
