// A virtual engine with a pressure sensor beside an online calibration of a guide that is wrong about it.
#pragma once

#include "mgdd/guide/online_calibration.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "support/bench_case.hpp"
#include "support/test.hpp"

namespace mgdd::test_support {

inline constexpr int wall = guide::Calibrated::wall_heat_scale;

/// The default engine without scatter of the start of combustion; its wall heat is 0.5.
inline loop::BenchSettings steady_bench(double noise_bar = 0.0, std::uint64_t seed = 0) {
  loop::BenchSettings s = quiet_bench();
  s.pressure.noise_bar = noise_bar;
  s.seed = seed;
  return s;
}

/// A guide with another wall heat, which takes the timing as told.
inline guide::OnlineCalibrationSettings wrong_guide(guide::CalibrationMethod method, double wall_heat_scale = 1.0) {
  guide::OnlineCalibrationSettings s;
  s.cylinder.wall_heat.wall_heat_scale = wall_heat_scale;
  s.method = method;
  s.soc_scatter_cad = 0.0;
  return s;
}

/// Compression ratio and temperatures exactly as the guide has them, as those of a virtual engine may be.
inline guide::OnlineCalibrationSettings sure_of_the_engine(guide::OnlineCalibrationSettings s) {
  for (const int i : {guide::Calibrated::compression_ratio, guide::Calibrated::charge_temperature,
                      guide::Calibrated::wall_temperature})
    s.uncertainty[guide::place(i)] = 0.0;
  return s;
}

/// Everything beside the wall heat exactly as the guide has it.
inline guide::OnlineCalibrationSettings sure_of_the_rest(guide::OnlineCalibrationSettings s) {
  s.uncertainty.fill(0.0);
  return s;
}

/// One cycle of the engine, offered and used; what the update came to.
inline guide::CalibrationStatus cycle_of(loop::VirtualEngine& bench, guide::OnlineCalibration& calibration,
                                         double soc_cad = -6.0, double told_error_cad = 0.0) {
  const engine::OperatingPoint point = bench.point();
  const loop::BenchCycle c = bench.step(soc_cad);
  calibration.offer(bench.pressure().pressure_bar, point, c.soc_cad + told_error_cad, c.misfire);
  return calibration.update();
}

inline void run(loop::VirtualEngine& bench, guide::OnlineCalibration& calibration, int cycles, double soc_cad = -6.0,
                double told_error_cad = 0.0) {
  for (int k = 0; k < cycles; ++k)
    cycle_of(bench, calibration, soc_cad, told_error_cad);
}

}  // namespace mgdd::test_support
