// Curve-guided seeking on the curve of `puma_single`, and the whole guided loop of an engine on the virtual bench.
// Before timing, each must have found the best timing of the bench.
#include <benchmark/benchmark.h>

#include <cmath>

#include "mgdd/guide/guided_engine.hpp"
#include "mgdd/loop/virtual_engine.hpp"

namespace {

using namespace mgdd;
using optimize::scalar_input;

constexpr double best_cad = -5.63;

guide::ModelOptimum rough_model() {
  guide::ModelOptimumSettings s;
  s.cylinder.wall_heat.wall_heat_scale = 1.0;  // the bench has 0.5
  return guide::ModelOptimum(s);
}

guide::CurveSeeking seeker_of(guide::ModelOptimum model, bool limited) {
  guide::CurveSeekingSettings s;
  guide::Curve peak;
  double engine::Indicators<double>::* const members[] = {&engine::Indicators<double>::p_max_bar};
  model.tabulate({}, s.curve, members, {&peak, 1});
  s.space = {scalar_input(s.curve.best()), scalar_input(-30.0), scalar_input(10.0)};
  if (limited) {
    s.limits = {optimize::Limit{"p_max_bar", 150.0}};
    s.limit_curves = {peak};
  }
  return guide::CurveSeeking(s);
}

void ask_and_tell(benchmark::State& state, bool limited) {
  guide::CurveSeeking seeker = seeker_of(rough_model(), limited);
  const double pressure[] = {105.0};
  const auto cycle = [&] {
    const double away = seeker.ask()[0] - best_cad;
    const double j[] = {-0.0255 * away * away};
    seeker.tell({j, limited ? std::span<const double>(pressure) : std::span<const double>(), false});
  };
  for (int k = 0; k < 60; ++k)
    cycle();
  if (!(std::abs(seeker.estimate()[0] - best_cad) < 0.5)) {
    state.SkipWithError("the best timing was not found");
    return;
  }
  for ([[maybe_unused]] auto _ : state)
    cycle();
}
BENCHMARK_CAPTURE(ask_and_tell, curve, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(ask_and_tell, curve_with_a_limit, true)->Unit(benchmark::kMicrosecond);

// The plant's cycle is simulated too; the calibration moves the model in every cycle.
void guided_cycle(benchmark::State& state) {
  loop::BenchSettings b;
  b.pressure.noise_bar = 0.1;
  loop::VirtualEngine bench(b);
  guide::OnlineCalibrationSettings c;
  c.cylinder.wall_heat.wall_heat_scale = 1.0;
  c.window.steady_cycles = 0;
  guide::GuidedEngine guided(seeker_of(rough_model(), false), rough_model(),
                             std::optional<guide::OnlineCalibration>(std::in_place, c), {}, {.recalibrated_cad = 0.0});
  const auto cycle = [&] {
    guided.at(bench.point());
    const loop::BenchCycle measured = bench.step(guided.ask()[0]);
    const double j[] = {measured.j};
    guided.tell({j, {}, measured.misfire}, bench.pressure().pressure_bar);
  };
  for (int k = 0; k < 100; ++k)
    cycle();
  if (!(std::abs(guided.estimate()[0] - best_cad) < 1.5 && guided.recalibrations() > 0)) {
    state.SkipWithError("the best timing was not found");
    return;
  }
  const auto before = guided.recalibrations();
  for ([[maybe_unused]] auto _ : state)
    cycle();
  state.counters["recalibrations"] =
      benchmark::Counter(static_cast<double>(guided.recalibrations() - before), benchmark::Counter::kAvgIterations);
}
BENCHMARK(guided_cycle)->Unit(benchmark::kMicrosecond);

}  // namespace
