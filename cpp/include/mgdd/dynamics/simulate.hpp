// Runs of a discrete model over sampled inputs. noexcept and heap-free as the model is; units are the model's own.
#pragma once

#include <cstddef>
#include <span>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::dynamics {

/// Free run of n samples: `visit(k, output at sample k)` may stop it by returning false; `input(k)` acts from sample k
/// to k + 1. `state` ends at the last sample. True when all samples were visited.
template <DiscreteModel M, class Inputs, class Visit>
MGDD_INLINE bool run(const M& model, typename M::State& state, std::size_t n, Inputs&& input, Visit&& visit) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    if (!visit(k, model.output(state))) return false;
    if (k + 1 < n) model.step(state, input(k));
  }
  return true;
}

/// Free run of a model of one input: entry k is the output at sample k; input[k] acts until sample k + 1.
template <DiscreteModel M, class U>
void simulate(const M& model, typename M::State& state, std::span<const U> input,
              std::span<typename M::Scalar> output) noexcept {
  run(
      model, state, input.size(), [&](std::size_t k) { return input_of(model, input[k]); },
      [&](std::size_t k, const typename M::Scalar& y) {
        output[k] = y;
        return true;
      });
}

}  // namespace mgdd::dynamics
