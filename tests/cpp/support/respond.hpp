// The outputs of a model ahead of a state, sample by sample: what predictions are compared with.
#pragma once

#include <vector>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::test_support {

/// Entry k is the output after input[0..k] have acted.
template <dynamics::DiscreteModel M, class Inputs>
std::vector<typename M::Scalar> respond(const M& model, typename M::State state, const Inputs& inputs) {
  std::vector<typename M::Scalar> out;
  for (const auto& input : inputs) {
    model.step(state, dynamics::input_of(model, input));
    out.push_back(model.output(state));
  }
  return out;
}

}  // namespace mgdd::test_support
