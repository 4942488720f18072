// Throttle plant at 0.1 ms steps: simulated seconds per second, one run and eight lanes, every friction form.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "mgdd/throttle/simulation.hpp"

namespace {

using namespace mgdd::throttle;

constexpr double sample_s = 1e-3;
constexpr std::size_t steps = 10;

std::vector<double> chirp(double seconds) {
  std::vector<double> duty(static_cast<std::size_t>(seconds / sample_s));
  for (std::size_t k = 0; k < duty.size(); ++k) {
    const double t = static_cast<double>(k) * sample_s;
    duty[k] = 0.15 + 0.20 * std::sin(2.0 * 3.141592653589793 * (0.2 * t + 5.8 * t * t / (2.0 * seconds)));
  }
  return duty;
}

Throttle preset(std::int64_t form) {
  Throttle t;
  t.friction = static_cast<Friction>(form);
  t.stiction_nm = 0.30;
  return t;
}

void report(benchmark::State& state, double seconds) {
  state.SetLabel(std::string(mgdd::name_of(friction_names(), static_cast<Friction>(state.range(0)))));
  state.counters["times_real_time"] =
      benchmark::Counter(seconds, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kDefaults);
}

void one_run(benchmark::State& state) {
  const std::vector<double> duty = chirp(12.0);
  std::vector<double> angle(duty.size());
  const ThrottlePlant plant(preset(state.range(0)));
  ThrottleColumns columns;
  columns.angle_deg = angle;
  for (auto _ : state) {
    ThrottleState s = at_rest(8.0);
    simulate(plant, {.duty = duty}, steps, s, columns);
    benchmark::DoNotOptimize(angle.data());
  }
  report(state, 12.0);
}

void many_runs(benchmark::State& state) {
  const std::vector<double> duty = chirp(12.0);
  std::vector<ThrottleCase> cases(8, {preset(state.range(0)), at_rest(8.0)});
  for (std::size_t i = 0; i < cases.size(); ++i)
    cases[i].throttle.coulomb_nm *= 1.0 - 0.01 * static_cast<double>(i);
  for (auto _ : state)
    benchmark::DoNotOptimize(simulate_many(cases, {.duty = duty}, steps, default_step_s).data());
  report(state, 12.0 * static_cast<double>(cases.size()));
}

BENCHMARK(one_run)->DenseRange(0, 5);
BENCHMARK(many_runs)->DenseRange(0, 5);

}  // namespace

BENCHMARK_MAIN();
