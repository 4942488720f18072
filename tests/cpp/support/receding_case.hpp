// A receding horizon on an oscillator and on a pendulum: models, settings whose limits differ, and a reference.
#pragma once

#include <array>
#include <cmath>

#include "mgdd/control/receding_horizon.hpp"
#include "mgdd/dynamics/rk4.hpp"
#include "support/horizon_case.hpp"

namespace mgdd::test_support {

using control::HorizonSettings;

inline constexpr int length = 16;

template <class T>
auto oscillator() {
  return dynamics::Rk4<LaggedOscillator>{}.prepare(std::array{T(5.0)}, 0.05);
}
template <class T>
auto pendulum() {
  return dynamics::Rk4<Pendulum>{}.prepare(std::array{T(0.8)}, 0.05);
}
template <class T>
using Oscillator = decltype(oscillator<T>());
template <class T>
using Swinging = decltype(pendulum<T>());

inline HorizonSettings narrow_settings() {
  HorizonSettings s;
  s.output_weight = 3.0;
  s.terminal_weight = 11.0;
  s.input_weight = 2e-3;
  s.change_weight = 1e-2;
  s.lower = -0.45;
  s.upper = 0.8;
  s.largest_change = 0.17;
  return s;
}

inline double reference_of(int k) {
  return (k / 40) % 2 == 0 ? 0.5 : -0.2 + 0.1 * std::sin(0.11 * k);
}

}  // namespace mgdd::test_support
