// A horizon ahead of a state, as a predictive controller asks for it once per period: outputs and their exact slopes to
// the moves. noexcept, heap-free; double or float. Source of the slopes: Griewank and Walther 2008, chapter 3.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::dynamics {

/// The horizon of a model of one input: moves[m] is held for lengths[m] samples. `output[k]` is the output after sample
/// k, `slope[k]` its derivatives to the moves.
template <int n_moves, DiscreteModel M, class PlainState, std::floating_point S>
void predict(const M& model, const PlainState& state, const std::array<S, static_cast<std::size_t>(n_moves)>& moves,
             const std::array<int, static_cast<std::size_t>(n_moves)>& lengths,
             std::type_identity_t<std::span<S>> output,
             std::type_identity_t<std::span<std::array<S, static_cast<std::size_t>(n_moves)>>> slope) noexcept {
  using D = Dual<n_moves, S>;
  const auto dual = model.template over<D>();
  auto s = lifted<std::remove_const_t<decltype(dual)>>(state);
  std::size_t k = 0;
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const auto input = input_of(dual, D::seeded(moves[m], static_cast<int>(m)));
    for (int i = 0; i < lengths[m]; ++i, ++k) {
      dual.step(s, input);
      const D y = dual.output(s);
      output[k] = y.value;
      std::ranges::copy(y.grad, slope[k].begin());
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
