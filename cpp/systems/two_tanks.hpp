// Two tanks in a row under a pump, with overflow: levels in the unit of the level sensor (V), pump input V, time s.
// step() is noexcept and heap-free. Balance of a tank: Torricelli's law with a free exponent and a free
// datum instead of the square root, because outlet pipes are neither sharp-edged nor level with the sensor's zero.
// Overflow as in Schoukens and Noël 2017: what leaves the upper tank over its brim lands in the lower one in part.
#pragma once

#include <array>

#include "mgdd/common/record.hpp"
#include "mgdd/dynamics/delay_line.hpp"
#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::systems {

using dynamics::Values;

template <class T>
struct TankState {
  T upper_v{0.0};
  T lower_v{0.0};
  dynamics::DelayLine<T, 2> pump{};
};

/// Prepared: coefficients C on states of T, the same or plain numbers on duals.
template <class T, class C = T>
struct TankModel {
  using Scalar = T;
  using State = TankState<T>;
  using Input = T;
  static constexpr int n_observed = 2;

  Values<C, 9> parameters;
  C lower_brim;
  int substeps;
  double sample;

  MGDD_INLINE void step(State& s, const T& pump_v) const noexcept {
    const auto& [pump, k_upper, e_upper, k_lower, e_lower, datum, brim, share, delay] = parameters;
    const T zero(0.0);
    const T voltage = s.pump.at(pump_v, T(delay));
    const T inflow = select(voltage > zero, pump * voltage, zero);
    const C h = C(sample / substeps);
    for (int k = 0; k < substeps; ++k) {
      const T out_upper = outflow(k_upper, s.upper_v, e_upper);
      const T out_lower = outflow(k_lower, s.lower_v - datum, e_lower);
      s.upper_v += h * (inflow - out_upper);
      const T gain = h * (out_upper - out_lower);
      const auto over = s.upper_v > T(brim);
      s.lower_v += select(over, gain + share * (s.upper_v - brim), gain);
      s.upper_v = select(over, T(brim), s.upper_v);
      s.upper_v = select(s.upper_v < zero, zero, s.upper_v);
      s.lower_v = smaller(s.lower_v, T(lower_brim));
    }
    s.pump.push(pump_v);
  }
  MGDD_INLINE T output(const State& s) const noexcept { return s.lower_v; }
  double sample_s() const noexcept { return sample; }
  /// The level of the lower tank as it is, the upper one empty, the pump off.
  State at_rest(const T& lower_v) const noexcept { return {T(0.0), lower_v, {}}; }

  template <class U>
  TankModel<U, C> over() const noexcept {
    return {parameters, lower_brim, substeps, sample};
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::array{&s.upper_v, &s.lower_v, &s.pump.before[0], &s.pump.before[1]};
  }

 private:
  MGDD_INLINE static T outflow(const C& factor, const T& level, const C& exponent) noexcept {
    return select(level > T(0.0), factor * pow_of(level, exponent), T(0.0));
  }
};

struct TwoTanks {
  static constexpr int n_parameters = 9;
  static constexpr int n_start = 4;

  static constexpr std::array<FieldInfo, 9> parameters = {{
      {"pump_per_s", "1/s", closed(1e-5, 10.0), "level rate per pump volt"},
      {"upper_outflow_per_s", "1/s", closed(1e-6, 10.0), "k1 of the upper outflow k1 x1^p1"},
      {"upper_exponent", "-", closed(0.05, 2.0), "p1 of the upper outflow"},
      {"lower_outflow_per_s", "1/s", closed(1e-6, 10.0), "k2 of the lower outflow k2 (x2 - datum)^p2"},
      {"lower_exponent", "-", closed(0.05, 2.0), "p2 of the lower outflow"},
      {"lower_datum_v", "V", closed(-5.0, 5.0), "reading at which the lower outlet runs dry"},
      {"upper_brim_v", "V", closed(1.0, 200.0), "level at which the upper tank runs over"},
      {"overflow_share", "-", closed(0.0, 1.0), "share of the upper overflow that lands in the lower tank"},
      {"delay_samples", "samples", closed(0.0, 2.0), "delay of the pump, interpolated"},
  }};
  /// The upper level is not measured: its unit is that of the lower level times the ratio of the floor areas.
  static constexpr std::array<FieldInfo, 4> start_numbers = {
      {{"upper_level_v", "V", closed(0.0, 200.0), "level of the upper tank"},
       {"lower_level_v", "V", closed(-5.0, 20.0), "level of the lower tank"},
       {"pump_before_v", "V", closed(-100.0, 100.0), "input of the sample before"},
       {"pump_before_that_v", "V", closed(-100.0, 100.0), "input of the sample before that"}}};

  double lower_brim_v = 10.0;  ///< the lower tank runs over here, and the sensor ends here
  int substeps = 10;           ///< of the explicit Euler step; the tanks' time constants are minutes

  template <class T>
  TankModel<T> prepare(const Values<T, 9>& p, double sample_s) const noexcept {
    return {p, T(lower_brim_v), substeps, sample_s};
  }
  template <class T, class Model>
  auto start(const Model&, const Values<T, 4>& stated) const noexcept {
    return typename Model::State{stated[0], stated[1], {{stated[2], stated[3]}}};
  }
};

static_assert(dynamics::DescribedFamily<TwoTanks> && dynamics::on_every_scalar<TwoTanks> &&
              dynamics::StartsAtRest<TankModel<double>>);

}  // namespace mgdd::systems
