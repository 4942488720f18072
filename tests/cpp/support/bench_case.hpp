// Benches without chance, and the comparison of two of their cycles bit for bit.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "mgdd/loop/virtual_engine.hpp"

namespace mgdd::test_support {

/// No scatter, no noise, true NOx in the performance with the weight given.
inline loop::BenchSettings quiet_bench(double nox_weight = 0.004) {
  loop::BenchSettings s;
  s.soc_scatter_cad = s.efficiency_noise_percent = 0.0;
  s.analyser.noise_fraction = s.fast_sensor.noise_fraction = 0.0;
  s.performance = engine::efficiency_and_nox(nox_weight);
  s.nox_sensor = loop::NoxSensor::true_value;
  return s;
}

/// Every number and flag of a cycle as bits.
inline std::vector<std::uint64_t> bits_of(const loop::BenchCycle& c) {
  std::vector<double> numbers{c.soc_requested_cad, c.soc_cad,      c.nox_true_ppm,           c.nox_analyser_ppm,
                              c.nox_fast_ppm,      c.nox_soft_ppm, c.nox_soft_corrected_ppm, c.j};
  for (const auto& field : engine::indicator_fields<double>())
    numbers.push_back(c.indicators.*(field.member));
  numbers.insert(numbers.end(), c.components.begin(), c.components.end());
  numbers.insert(numbers.end(), c.limit_values.begin(), c.limit_values.end());
  std::vector<std::uint64_t> bits{static_cast<std::uint64_t>(c.cycle),
                                  c.component_count,
                                  c.limit_count,
                                  c.misfire,
                                  c.clamped,
                                  c.unphysical,
                                  c.operating_point_changed};
  for (const double x : numbers)
    bits.push_back(std::bit_cast<std::uint64_t>(x));
  return bits;
}

/// A timing that wanders, as a seeker's would.
inline double wandering_soc_cad(std::int64_t cycle) {
  return -8.0 + 5.0 * static_cast<double>((cycle * 37) % 101) / 101.0;
}

}  // namespace mgdd::test_support
