// The literal cycle behind a C interface, for `benchmarks/sweep_speed.py`: the same points, process and clock as its
// contenders. One core; no checks of the input, which the script makes itself.
#include <algorithm>
#include <cstddef>
#include <limits>

#include "literal_cycle.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/indicators.hpp"

#ifdef _WIN32
#define MGDD_BENCH_EXPORT __declspec(dllexport)
#else
#define MGDD_BENCH_EXPORT __attribute__((visibility("default")))
#endif

namespace {

using namespace mgdd::engine;

// The eight figures that every contender returns, and no more: whoever compares speed computes the same.
void figures_of(const CycleModel<double>& model, const Charge<double>& charge, const CycleWorkspace<double>& work,
                double* out) {
  const auto angle = model.angles_cad();
  const auto volume = model.volume_m3();
  const std::vector<double>& p = work.pressure_pa;
  const std::size_t n = angle.size();
  double closed = 0.0, loss = 0.0, slope_best = -std::numeric_limits<double>::infinity();
  std::size_t p_at = 0, slope_at = 0;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    closed += 0.5 * (p[k] + p[k + 1]) * (volume[k + 1] - volume[k]);
    loss += work.heat_loss_j[k];
    if (p[k + 1] > p[p_at]) p_at = k + 1;
    const double slope = (p[k + 1] - p[k]) / (angle[k + 1] - angle[k]);
    if (slope > slope_best) slope_best = slope, slope_at = k;
  }
  const Geometry<double>& g = model.geometry();
  const double bottom = g.clearance_m3 + g.swept_m3;
  const double gross =
      closed + charge.intake_pa * (volume[0] - bottom) + 0.5 * (p[n - 1] + charge.intake_pa) * (bottom - volume[n - 1]);
  const Peak<double> peak = parabola_peak(samples_around<double>(angle, p_at, [&p](std::size_t k) { return p[k]; }));
  const double values[] = {closed / g.swept_m3 / mgdd::units::pa_per_bar,
                           gross / g.swept_m3 / mgdd::units::pa_per_bar,
                           gross / charge.fuel_heat_j,
                           peak.value / mgdd::units::pa_per_bar,
                           peak.angle_cad,
                           slope_best / mgdd::units::pa_per_bar,
                           0.5 * (angle[slope_at] + angle[slope_at + 1]),
                           loss};
  std::copy(std::begin(values), std::end(values), out);
}

}  // namespace

extern "C" {

// Rows of (speed [rpm], fuel [mg], intake pressure [kPa], intake temperature [K], SOC [°CA aTDC]) to rows of eight
// figures, on the default cylinder with a step of 1 °CA.
MGDD_BENCH_EXPORT void mgdd_literal_cycles(const double* cases, std::size_t n_cases, double* figures) {
  const CycleModel<double> model(Cylinder{}, crank_grid(Cylinder{}));
  const LiteralCycle printed(model);
  CycleWorkspace<double> work = model.make_workspace();
  for (std::size_t i = 0; i < n_cases; ++i) {
    const double* row = cases + 5 * i;
    OperatingPoint point;
    point.speed_rpm = row[0];
    point.fuel_mg = row[1];
    point.intake_pressure_kpa = row[2];
    point.intake_temperature_k = row[3];
    const Charge<double> charge = model.charge(point);
    printed.run<false>(charge, model.geometry(), row[4], work);
    figures_of(model, charge, work, figures + 8 * i);
  }
}

MGDD_BENCH_EXPORT const char* mgdd_literal_compiler() {
#ifdef __VERSION__
  return __VERSION__;
#else
  return "?";
#endif
}
}
