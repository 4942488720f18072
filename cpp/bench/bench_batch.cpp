// Many cycles: a timing sweep at one operating point and arbitrary points on `puma_single` (270 steps), one by one, in
// lanes and with shared tables, per instruction set, and the literal form beside them. Agreement comes first; the
// counter `us_per_cycle` is what to compare.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include "literal_cycle.hpp"
#include "mgdd/engine/batch/batch.hpp"

namespace {

using namespace mgdd;
using namespace mgdd::engine;

constexpr std::size_t n_cases = 16384;

struct Cases {
  std::vector<double> values;
  BatchCases cases;

  explicit Cases(bool sweep) {
    std::mt19937 random(1);
    const auto within = [&random](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
    };
    for (std::size_t i = 0; i < n_cases; ++i) {
      if (sweep) {
        values.push_back(-30.0 + 40.0 * static_cast<double>(i) / static_cast<double>(n_cases));
        continue;
      }
      for (const double x : {within(800, 4000), within(5, 50), within(100, 250), within(290, 350), within(-30, 10)})
        values.push_back(x);
    }
    if (sweep) {
      cases.names = {"soc_cad"};
    } else {
      cases.names = {"speed_rpm", "fuel_mg", "intake_pressure_kpa", "intake_temperature_k", "soc_cad"};
    }
    cases.values = values;
  }
};

std::vector<IndicatorMember> members() {
  std::vector<IndicatorMember> all;
  for (const auto& field : indicator_fields<double>())
    all.push_back(field.member);
  return all;
}

struct Results {
  std::vector<std::vector<double>> columns;
  std::vector<double*> to;
  Results() : columns(members().size(), std::vector<double>(n_cases)) {
    for (std::vector<double>& column : columns)
      to.push_back(column.data());
  }
  double difference(const Results& other) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < columns.size(); ++i)
      for (std::size_t row = 0; row < n_cases; ++row)
        worst = std::max(
            worst, std::abs(columns[i][row] - other.columns[i][row]) / std::max(1.0, std::abs(other.columns[i][row])));
    return worst;
  }
};

void per_cycle(benchmark::State& state) {
  state.counters["us_per_cycle"] =
      benchmark::Counter(static_cast<double>(n_cases) * static_cast<double>(state.iterations()) * 1e-6,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void batch(benchmark::State& state, bool sweep, BatchForm form, InstructionSet set) {
  if (set > instruction_set()) return state.SkipWithError("this processor does not have that instruction set");
  const Cases table(sweep);
  const std::vector<IndicatorMember> outputs = members();
  BatchSettings settings;
  settings.threads = 1;
  settings.form = BatchForm::single;
  Results expected, found;
  simulate_batch(table.cases, settings, outputs, expected.to);
  settings.form = form;
  settings.set = set;
  simulate_batch(table.cases, settings, outputs, found.to);
  const double bar = form == BatchForm::shared ? 1e-6 : 1e-9;
  if (!(found.difference(expected) < bar)) return state.SkipWithError("the forms disagree");
  for (auto _ : state)
    simulate_batch(table.cases, settings, outputs, found.to);
  per_cycle(state);
}

// The printed equations, case by case; its indicators are the model's.
void literal(benchmark::State& state, bool sweep) {
  const Cases table(sweep);
  const CycleModel<double> model(Cylinder{}, crank_grid(Cylinder{}));
  const LiteralCycle printed(model);
  CycleWorkspace<double> work = model.make_workspace();
  const auto point_of = [&](std::size_t row) {
    OperatingPoint point;
    if (sweep) return point;
    const double* x = table.values.data() + 5 * row;
    point.speed_rpm = x[0], point.fuel_mg = x[1], point.intake_pressure_kpa = x[2], point.intake_temperature_k = x[3];
    return point;
  };
  const auto soc_of = [&](std::size_t row) { return sweep ? table.values[row] : table.values[5 * row + 4]; };
  for (const std::size_t row : {std::size_t{3}, n_cases / 2, n_cases - 1}) {
    const Charge<double> charge = model.charge(point_of(row));
    model.run(charge, soc_of(row), work);
    const Indicators<double> expected = model.indicators(charge, soc_of(row), work);
    printed.run<true>(charge, model.geometry(), soc_of(row), work);
    const std::string wrong = disagreement(expected, model.indicators(charge, soc_of(row), work));
    if (!wrong.empty()) return state.SkipWithError(("literal form and model disagree in " + wrong).c_str());
  }
  for (auto _ : state) {
    for (std::size_t row = 0; row < n_cases; ++row) {
      const Charge<double> charge = model.charge(point_of(row));
      printed.run<true>(charge, model.geometry(), soc_of(row), work);
      benchmark::DoNotOptimize(model.indicators(charge, soc_of(row), work));
    }
  }
  per_cycle(state);
}

using enum BatchForm;
using enum InstructionSet;
BENCHMARK_CAPTURE(literal, sweep, true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, sweep_single, true, single, baseline)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, sweep_lanes_avx2, true, lanes, avx2)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, sweep_shared_sse2, true, shared, baseline)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, sweep_shared_avx2, true, shared, avx2)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, sweep_shared_avx512, true, shared, avx512f)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(literal, points, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, points_single, false, single, baseline)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, points_lanes_sse2, false, lanes, baseline)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, points_lanes_avx2, false, lanes, avx2)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(batch, points_lanes_avx512, false, lanes, avx512f)->Unit(benchmark::kMillisecond);

}  // namespace
