// One cycle of an online calibration, offered and used, by each method, on `puma_single` with a noisy pressure sensor.
// Before timing, each must have found the wall heat of the engine.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "mgdd/guide/online_calibration.hpp"
#include "mgdd/loop/virtual_engine.hpp"

namespace {

using namespace mgdd;
using guide::Calibrated;
using guide::CalibrationMethod;
using guide::OnlineCalibration;

std::vector<std::vector<double>> traces() {
  loop::BenchSettings s;
  s.soc_scatter_cad = 0.0;
  s.pressure.noise_bar = 0.05;
  loop::VirtualEngine bench(s);
  std::vector<std::vector<double>> out;
  for (int k = 0; k < 64; ++k) {
    bench.step(-6.0);
    const auto shown = bench.pressure().pressure_bar;
    out.emplace_back(shown.begin(), shown.end());
  }
  return out;
}

void calibrate(benchmark::State& state, CalibrationMethod method) {
  const std::vector<std::vector<double>> measured = traces();
  guide::OnlineCalibrationSettings settings;
  settings.method = method;
  settings.cylinder.wall_heat.wall_heat_scale = 1.0;
  OnlineCalibration calibration(settings);
  const auto cycle = [&](std::size_t k) {
    calibration.offer(measured[k % measured.size()], {}, -6.0);
    benchmark::DoNotOptimize(calibration.update());
  };
  for (std::size_t k = 0; k < 100; ++k)
    cycle(k);
  if (!(std::abs(calibration.parameters()[Calibrated::wall_heat_scale] - 0.5) < 0.025)) {
    state.SkipWithError("the wall heat was not found");
    return;
  }
  std::size_t k = 0;
  for ([[maybe_unused]] auto _ : state)
    cycle(k++);
}
BENCHMARK_CAPTURE(calibrate, gauss_newton, CalibrationMethod::gauss_newton)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(calibrate, recursive, CalibrationMethod::recursive)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(calibrate, extremum_seeking, CalibrationMethod::extremum_seeking)->Unit(benchmark::kMicrosecond);

}  // namespace
