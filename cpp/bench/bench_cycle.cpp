// One scalar cycle with its indicators on `puma_single` (270 steps): each integrator, gamma, wall-heat and burn law,
// the differentiated cycle, and the literal `pow` form of the same equations, which must agree to 1e-9 before it is
// timed.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstddef>
#include <string>

#include "literal_cycle.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/fast_power.hpp"

namespace {

using namespace mgdd;
using namespace mgdd::engine;

constexpr double soc_cad = -6.0;

struct Variant {
  BurnShape burn = BurnShape::triangle;
  Integrator integrator = Integrator::trapezoid;
  GammaModel gamma = GammaModel::constant;
  WallHeatModel wall = WallHeatModel::woschni;
};

template <class T>
BasicCylinder<T> cylinder(const Variant& v) {
  BasicCylinder<T> c;
  c.burn.burn_shape = v.burn;
  c.gas.gamma_model = v.gamma;
  c.wall_heat.wall_heat_model = v.wall;
  return c;
}

template <class T>
void run(benchmark::State& state, const Variant& v) {
  const CycleModel<T> model(cylinder<T>(v), crank_grid(Cylinder{}), v.integrator);
  CycleWorkspace<T> work = model.make_workspace();
  const Charge<T> charge = model.charge({});
  T soc(soc_cad);
  if constexpr (is_dual_v<T>) soc = T::seeded(soc_cad, 0);
  for (auto _ : state) {
    model.run(charge, soc, work);
    benchmark::DoNotOptimize(model.indicators(charge, soc, work));
  }
  state.SetItemsProcessed(state.iterations());
}
void cycle(benchmark::State& state, const Variant& v) {
  run<double>(state, v);
}
void dual_cycle(benchmark::State& state, const Variant& v) {
  run<Dual<4>>(state, v);
}

BENCHMARK_CAPTURE(cycle, triangle, Variant{});
BENCHMARK_CAPTURE(cycle, wiebe, Variant{.burn = BurnShape::wiebe});
BENCHMARK_CAPTURE(cycle, double_wiebe, Variant{.burn = BurnShape::double_wiebe});
BENCHMARK_CAPTURE(cycle, split, Variant{.integrator = Integrator::split});
BENCHMARK_CAPTURE(cycle, tan2018_lagged, Variant{.integrator = Integrator::tan2018_lagged});
BENCHMARK_CAPTURE(cycle, euler, Variant{.integrator = Integrator::euler});
BENCHMARK_CAPTURE(cycle, gamma_linear, Variant{.gamma = GammaModel::linear});
BENCHMARK_CAPTURE(cycle, gamma_polynomial, Variant{.gamma = GammaModel::polynomial});
BENCHMARK_CAPTURE(cycle, hohenberg, Variant{.wall = WallHeatModel::hohenberg});
BENCHMARK_CAPTURE(cycle, eichelberg, Variant{.wall = WallHeatModel::eichelberg});
BENCHMARK_CAPTURE(dual_cycle, triangle, Variant{});
BENCHMARK_CAPTURE(dual_cycle, wiebe_gamma_linear, Variant{.burn = BurnShape::wiebe, .gamma = GammaModel::linear});

// --- the literal form -----------------------------------------------------------------------------------------

template <bool MotoredTable>
void literal(benchmark::State& state) {
  const CycleModel<double> model(Cylinder{}, crank_grid(Cylinder{}));
  const LiteralCycle printed(model);
  const Charge<double> charge = model.charge({});
  CycleWorkspace<double> work = model.make_workspace();
  model.run(charge, soc_cad, work);
  const Indicators<double> expected = model.indicators(charge, soc_cad, work);
  printed.run<MotoredTable>(charge, model.geometry(), soc_cad, work);
  const std::string wrong = disagreement(expected, model.indicators(charge, soc_cad, work));
  if (!wrong.empty()) return state.SkipWithError(("literal form and model disagree in " + wrong).c_str());
  for (auto _ : state) {
    printed.run<MotoredTable>(charge, model.geometry(), soc_cad, work);
    benchmark::DoNotOptimize(model.indicators(charge, soc_cad, work));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(literal<false>)->Name("literal/triangle");
BENCHMARK(literal<true>)->Name("literal/triangle_motored_table");

// --- the power in the chain from pressure to pressure -----------------------------------------------------------

// Each result is the next argument, as in the cycle: latency, not throughput.
template <class Power>
void chain_of(benchmark::State& state, Power power) {
  double x = 7.3;
  for (auto _ : state)
    benchmark::DoNotOptimize(x = power(x) + 6.0);
}
void power_chain(benchmark::State& state) {
  chain_of(state, [](double x) { return fast_power<4, 5>(x); });
}
void pow_chain(benchmark::State& state) {
  chain_of(state, [](double x) { return std::pow(x, 0.8); });
}
void exp_log_chain(benchmark::State& state) {
  chain_of(state, [](double x) { return std::exp(0.8 * std::log(x)); });
}
BENCHMARK(power_chain)->Name("power/fast_power");
BENCHMARK(pow_chain)->Name("power/pow");
BENCHMARK(exp_log_chain)->Name("power/exp_log");

// --- what the figures belong to ---------------------------------------------------------------------------------

const bool described = [] {
#ifdef __VERSION__
  benchmark::AddCustomContext("compiler", __VERSION__);
#endif
#if defined(__AVX512F__)
  benchmark::AddCustomContext("isa", "AVX-512");
#elif defined(__AVX2__)
  benchmark::AddCustomContext("isa", "AVX2");
#elif defined(__SSE2__)
  benchmark::AddCustomContext("isa", "SSE2");
#endif
  return true;
}();

}  // namespace
