// One sample of a model family from the numbers of a state, for tests that look at single steps.
#pragma once

#include <array>
#include <type_traits>

#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::test_support {

/// The numbers of the state after a step.
template <class Family, class T, std::size_t n_parameters, std::size_t n_start>
auto stepped(const Family& family, const std::array<T, n_parameters>& parameters, const std::array<T, n_start>& state,
             double input, double sample_s) noexcept {
  const auto model = family.template prepare<T>(parameters, sample_s);
  auto s = family.template start<T>(model, state);
  model.step(s, dynamics::input_of(model, input));
  std::array<T, n_start> out;
  const auto numbers = std::remove_const_t<decltype(model)>::numbers(s);
  for (std::size_t i = 0; i < n_start; ++i)
    out[i] = *numbers[i];
  return out;
}

}  // namespace mgdd::test_support
