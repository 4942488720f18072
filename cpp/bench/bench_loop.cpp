// One cycle of the virtual bench on `puma_single` against the bare cycle model that it wraps, whole loops one by one
// and in lanes, and one normal number. Before timing, the noise-free bench must give the indicators of the bare cycle.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "mgdd/common/random.hpp"
#include "mgdd/loop/monte_carlo.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "mgdd/loop/virtual_engine_lanes.hpp"

namespace {

using namespace mgdd;
using namespace mgdd::loop;

constexpr double soc_cad = -6.0;

BenchSettings quiet() {
  BenchSettings s;
  s.soc_scatter_cad = s.efficiency_noise_percent = 0.0;
  s.analyser.noise_fraction = s.fast_sensor.noise_fraction = 0.0;
  return s;
}

BenchSettings noisy() {
  BenchSettings s;
  s.performance = engine::efficiency_and_nox();
  return s;
}

BenchSettings everything() {
  BenchSettings s = noisy();
  s.misfire_probability = 0.01;
  s.soc_drift_cad_per_kcycle = 1e-6;
  s.wall_heat_drift_per_kcycle = 1e-6;
  s.limits = {"p_max_bar", "dp_max_bar_per_cad", "t_max_k", std::string(cov_imep_name)};
  s.delay_whole_objective = true;
  return s;
}

void cycle(benchmark::State& state) {
  const engine::CycleModel<double> model({}, engine::crank_grid({}));
  engine::CycleWorkspace<double> work = model.make_workspace();
  const engine::Charge<double> charge = model.charge({});
  model.run(charge, soc_cad, work);
  const double expected = model.indicators(charge, soc_cad, work).efficiency_gross;
  VirtualEngine bench(quiet());
  if (bench.step(soc_cad).indicators.efficiency_gross != expected) {
    return state.SkipWithError("bench and cycle disagree");
  }
  for (auto _ : state) {
    model.run(charge, soc_cad, work);
    benchmark::DoNotOptimize(model.indicators(charge, soc_cad, work));
  }
}
BENCHMARK(cycle)->Name("bench/bare_cycle");

void step(benchmark::State& state, const BenchSettings& settings) {
  VirtualEngine bench(settings);
  for (auto _ : state)
    benchmark::DoNotOptimize(bench.step(soc_cad));
}
BENCHMARK_CAPTURE(step, quiet, quiet())->Name("bench/step_quiet");
BENCHMARK_CAPTURE(step, noisy, noisy())->Name("bench/step_noisy");
BENCHMARK_CAPTURE(step, everything, everything())->Name("bench/step_everything");

/// Whole loops on one thread; the summaries must agree before timing.
void loops(benchmark::State& state, LoopForm form) {
  MonteCarloPlan plan;
  plan.benches.emplace_back(noisy());
  plan.criteria.push_back({.optimum_cad = -8.0});
  optimize::ExtremumSeekingSettings esc;
  esc.space = {optimize::scalar_input(-12.0), optimize::scalar_input(-30.0), optimize::scalar_input(10.0)};
  plan.seekers.emplace_back(optimize::ExtremumSeeking(esc));
  plan.seeds.resize(VirtualEngineLanes::width);
  for (std::size_t i = 0; i < plan.seeds.size(); ++i)
    plan.seeds[i] = i;
  plan.cycles = 500;
  plan.threads = 1;
  plan.form = LoopForm::single;
  const double expected = monte_carlo(plan, {}).loops.back().mean_cad;
  plan.form = form;
  if (std::abs(monte_carlo(plan, {}).loops.back().mean_cad - expected) > 1e-8) {
    return state.SkipWithError("lanes and single loops disagree");
  }
  for (auto _ : state)
    benchmark::DoNotOptimize(monte_carlo(plan, {}));
  const auto cycles = static_cast<double>(plan.seeds.size()) * static_cast<double>(plan.cycles);
  state.counters["cycles/s"] = benchmark::Counter(cycles, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK_CAPTURE(loops, single, LoopForm::single)->Name("loops/single")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loops, lanes, LoopForm::lanes)->Name("loops/lanes")->Unit(benchmark::kMillisecond);

void normal(benchmark::State& state) {
  std::uint64_t index = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(random::normal(1, 2, index++));
}
BENCHMARK(normal)->Name("random/normal");

}  // namespace
