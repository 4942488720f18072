// One scalar cycle with its indicators on `puma_single` (270 steps): each integrator, gamma, wall-heat and burn law,
// the differentiated cycle, and the literal `pow` form of the same equations, which must agree to 1e-9 before it is
// timed.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/wall_heat.hpp"
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
  c.burn_shape = v.burn;
  c.gamma_model = v.gamma;
  c.wall_heat_model = v.wall;
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
BENCHMARK_CAPTURE(cycle, seed, Variant{.integrator = Integrator::seed});
BENCHMARK_CAPTURE(cycle, euler, Variant{.integrator = Integrator::euler});
BENCHMARK_CAPTURE(cycle, gamma_linear, Variant{.gamma = GammaModel::linear});
BENCHMARK_CAPTURE(cycle, gamma_polynomial, Variant{.gamma = GammaModel::polynomial});
BENCHMARK_CAPTURE(cycle, hohenberg, Variant{.wall = WallHeatModel::hohenberg});
BENCHMARK_CAPTURE(dual_cycle, triangle, Variant{});
BENCHMARK_CAPTURE(dual_cycle, wiebe_gamma_linear, Variant{.burn = BurnShape::wiebe, .gamma = GammaModel::linear});

// --- the literal form -----------------------------------------------------------------------------------------

// Trapezoid, triangle, constant gamma and Woschni as printed: per step p^0.8, T^-0.55, w^0.8 and, where `motored_table`
// is false, (V_ref / V)^gamma. Geometry stands in tables, as in the model, and the indicators are the model's own.
struct LiteralCycle {
  Cylinder c;
  std::vector<double> angle, volume, area, motored;

  explicit LiteralCycle(const CycleModel<double>& model) : c(model.cylinder()) {
    for (const double a : model.angles_cad()) {
      angle.push_back(a);
      volume.push_back(model.geometry().volume_m3(a));
      area.push_back(model.geometry().wall_area_m2(volume.back()));
      motored.push_back(std::pow(volume.front() / volume.back(), c.gamma));
    }
  }

  template <bool MotoredTable>
  void run(const Charge<double>& charge, const Geometry<double>& g, double soc, CycleWorkspace<double>& work) const {
    const Burn<double> burn(c, soc, charge.burn_duration_cad);
    const double bore_power = c.wall_heat_scale * woschni_c1_bar_m * std::pow(g.bore_m, -0.2);
    const double speed = g.mean_piston_speed_m_per_s(charge.speed_rpm);
    const double reference_k = charge.pressure_pa * volume[0] / charge.gas_j_per_k;
    double pressure = charge.pressure_pa;
    double burned = burn.fraction(angle[0]);
    work.pressure_pa[0] = pressure;
    for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
      const double temperature = pressure * volume[k] / charge.gas_j_per_k;
      const double ratio = MotoredTable ? motored[k] : std::pow(volume[0] / volume[k], c.gamma);
      const double rise = pressure / charge.pressure_pa - ratio;
      const double velocity = woschni_velocity(c.woschni_c2, angle[k] >= soc ? c.woschni_cp_m_per_sk : 0.0, speed,
                                               g.swept_m3 / volume[0], reference_k, rise);
      const double film = bore_power * std::pow(pressure / units::pa_per_bar, 0.8) * std::pow(temperature, -0.55) *
                          std::pow(velocity, 0.8);
      const double time_s = (angle[k + 1] - angle[k]) / (units::cad_per_s_per_rpm * charge.speed_rpm);
      work.heat_loss_j[k] = film * area[k] * (temperature - c.wall_temperature_k) * time_s;
      const double next_burned = burn.fraction(angle[k + 1]);
      work.heat_release_j[k] = charge.fuel_heat_j * (next_burned - burned);
      burned = next_burned;
      const double heat = work.heat_release_j[k] - work.heat_loss_j[k];
      const double half = 0.5 * (volume[k + 1] - volume[k]);
      const double inner = c.gamma - 1.0;
      pressure = (pressure * (volume[k] / inner - half) + heat) / (volume[k + 1] / inner + half);
      work.pressure_pa[k + 1] = pressure;
    }
    work.heat_loss_j.back() = 0.0;
  }
};

// Name of the first indicator that differs by more than 1e-9 (of its size, or of 1); empty if none does.
std::string disagreement(const Indicators<double>& a, const Indicators<double>& b) {
  for (const auto& f : indicator_fields<double>()) {
    const double x = a.*(f.member);
    const double y = b.*(f.member);
    if (!(std::abs(x - y) <= 1e-9 * std::max(1.0, std::abs(x)))) return std::string(f.name);
  }
  return {};
}

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
