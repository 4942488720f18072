// Throttle plant at 0.1 ms steps: simulated seconds per second, one run and eight lanes, every friction form; eight
// loops with a PID controller at 1 kHz, one by one and side by side.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/loop/throttle_loop.hpp"
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
  state.SetLabel(std::string(mgdd::name_of(static_cast<Friction>(state.range(0)))));
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

// Eight loops of 2 s; the argument says whether side by side.
void closed_loops(benchmark::State& state) {
  namespace loop = mgdd::loop;
  loop::ThrottleScenario scenario;
  scenario.reference_deg.assign(1000, 20.0);
  scenario.reference_deg.resize(2000, 60.0);
  std::vector<loop::VirtualThrottleSettings> plants(8);
  for (std::size_t i = 0; i < plants.size(); ++i) {
    plants[i].throttle.coulomb_nm *= 1.0 - 0.01 * static_cast<double>(i);
    plants[i].start_deg = 20.0;
    plants[i].seed = i;
  }
  const mgdd::control::Pid pid{mgdd::control::PidSettings{}};
  for (auto _ : state) {
    std::vector<mgdd::control::Pid> controllers(plants.size(), pid);
    if (state.range(0) != 0) {
      benchmark::DoNotOptimize(
          loop::run_throttle_lanes(std::span(controllers), std::span(std::as_const(plants)), 1, scenario).data());
      continue;
    }
    for (std::size_t i = 0; i < plants.size(); ++i)
      benchmark::DoNotOptimize(loop::run_throttle_loop(controllers[i], plants[i], 1, scenario).duty.data());
  }
  state.SetLabel(state.range(0) != 0 ? "side by side" : "one by one");
  state.counters["times_real_time"] =
      benchmark::Counter(16.0, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kDefaults);
}

BENCHMARK(closed_loops)->DenseRange(0, 1);
BENCHMARK(one_run)->DenseRange(0, 5);
BENCHMARK(many_runs)->DenseRange(0, 5);

}  // namespace

BENCHMARK_MAIN();
