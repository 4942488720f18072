// A horizon ahead of a state under blocked moves, as a predictive controller asks for it once per period: outputs and
// their exact slopes to the moves and, chosen at compile time, to the numbers of the state (position, speed, bias ...)
// and to parameters. noexcept, heap-free; double or float. Source of the slopes: Griewank and Walther 2008, chapter 3.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::dynamics {

/// Beside the moves: the first `states` numbers of the state, and `parameters` numbers of the family.
struct Slopes {
  int states = 0;
  int parameters = 0;
};

/// Directions of a horizon: moves first, then state numbers, then parameters.
template <int n_moves, Slopes slopes = Slopes{}>
inline constexpr int n_directions = n_moves + slopes.states + slopes.parameters;

/// Parameters on the dual numbers of a horizon: `free[j]` carries direction n_moves + slopes.states + j. Prepare the
/// family with them for slopes to parameters.
template <int n_moves, Slopes slopes, std::floating_point S, std::size_t n>
std::array<Dual<n_directions<n_moves, slopes>, S>, n> seeded_parameters(
    const std::array<S, n>& values, const std::array<std::size_t, static_cast<std::size_t>(slopes.parameters)>& free) {
  std::array<Dual<n_directions<n_moves, slopes>, S>, n> out{};
  for (std::size_t i = 0; i < n; ++i)
    out[i] = values[i];
  for (std::size_t j = 0; j < free.size(); ++j)
    out[free[j]].grad[static_cast<std::size_t>(n_moves + slopes.states) + j] = S(1);
  return out;
}

/// The horizon of a model of one input: moves[m] is held for lengths[m] samples. `output[k]` is the output after sample
/// k, `slope[k]` its derivatives in the order of `n_directions`. The model is a plain one, or for slopes to parameters
/// one on dual numbers whose parameters are seeded.
template <int n_moves, Slopes slopes = Slopes{}, DiscreteModel M, class PlainState, std::floating_point S>
void predict(const M& model, const PlainState& state, const std::array<S, static_cast<std::size_t>(n_moves)>& moves,
             const std::array<int, static_cast<std::size_t>(n_moves)>& lengths,
             std::type_identity_t<std::span<S>> output,
             std::type_identity_t<std::span<std::array<S, static_cast<std::size_t>(n_directions<n_moves, slopes>)>>>
                 slope) noexcept {
  using D = Dual<n_directions<n_moves, slopes>, S>;
  static_assert(slopes.parameters == 0 || std::same_as<typename M::Scalar, D>, "prepare on seeded_parameters");
  const auto dual = model.template over<D>();
  using Model = decltype(dual);
  using Lifted = std::remove_const_t<Model>;
  auto s = lifted<Lifted>(state);
  const auto places = Lifted::numbers(s);
  static_assert(slopes.states <= static_cast<int>(n_numbers<Lifted>));
  for (std::size_t i = 0; i < static_cast<std::size_t>(slopes.states); ++i)
    places[i]->grad[static_cast<std::size_t>(n_moves) + i] = S(1);
  std::size_t k = 0;
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const auto input = input_of(dual, D::seeded(moves[m], static_cast<int>(m)));
    for (int i = 0; i < lengths[m]; ++i, ++k) {
      dual.step(s, input);
      const D y = dual.output(s);
      output[k] = y.value;
      slope[k] = y.grad;
    }
  }
}

/// The horizon of a model of one input that is free at every sample: `output[k]` after sample k, and
/// `slope(k, i, d output[k] / d input[i])` for every pair, in passes of some inputs. Heap-free.
template <DiscreteModel M, class Slope>
void predict_every_sample(const M& model, const typename M::State& state, std::span<const typename M::Scalar> input,
                          std::span<typename M::Scalar> output, Slope&& slope) noexcept {
  constexpr std::size_t lanes = 4;
  using D = Dual<static_cast<int>(lanes), typename M::Scalar>;
  const auto dual = model.template over<D>();
  using Lifted = std::remove_const_t<decltype(dual)>;
  for (std::size_t first = 0; first < input.size(); first += lanes) {
    auto s = lifted<Lifted>(state);
    for (std::size_t k = 0; k < input.size(); ++k) {
      const bool seeded = k >= first && k - first < lanes;
      dual.step(s, input_of(dual, seeded ? D::seeded(input[k], static_cast<int>(k - first)) : D(input[k])));
      const D y = dual.output(s);
      output[k] = y.value;
      for (std::size_t i = 0; i < lanes && first + i < input.size(); ++i)
        slope(k, first + i, y.grad[i]);
    }
  }
}

}  // namespace mgdd::dynamics
