#include "mgdd/engine/pressure/trace_analysis.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/charge.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/gas.hpp"
#include "mgdd/engine/pressure/burn_window.hpp"
#include "mgdd/engine/pressure/doubts.hpp"
#include "mgdd/engine/pressure/heat.hpp"
#include "mgdd/engine/pressure/smoothing.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"

namespace mgdd::engine {
namespace {

std::vector<double> part(const std::vector<double>& column, std::pair<std::size_t, std::size_t> range) {
  return {column.begin() + static_cast<std::ptrdiff_t>(range.first),
          column.begin() + static_cast<std::ptrdiff_t>(range.second)};
}

void require_absolute(const TraceAnalysis& a) {
  for (std::size_t k = 0; k < a.angle_cad.size(); ++k) {
    if (!(a.pressure_bar[k] > 0.0)) {
      throw DataError("pressure at " + text(a.angle_cad[k]) + " °CA aTDC is " + text(a.pressure_bar[k]) +
                      " bar after pegging: absolute pressure must be > 0; choose a pegging method");
    }
  }
}

// Volume and temperature of the gas, from the pressure as measured.
void describe_gas(TraceAnalysis& a, const CycleModel<double>& model, double gas_j_per_k) {
  const auto volume = model.volume_m3();
  for (std::size_t k = 0; k < a.angle_cad.size(); ++k) {
    a.volume_l.push_back(volume[k] / units::m3_per_l);
    a.temperature_k.push_back(a.pressure_bar[k] * units::pa_per_bar * volume[k] / gas_j_per_k);
  }
  a.work_closed_j = a.imep_closed_bar * units::pa_per_bar * model.geometry().swept_m3;
  a.t_max_k = *std::max_element(a.temperature_k.begin(), a.temperature_k.end());
}

// Net heat and wall loss of every step, from the smoothed pressure.
void release_heat(TraceAnalysis& a, const CycleModel<double>& model, const Charge<double>& charge,
                  const std::vector<double>& smooth_bar, double burn_from_cad, const TraceOptions& o) {
  const std::size_t n = a.angle_cad.size();
  const auto volume = model.volume_m3();
  std::vector<double> pressure_pa(n), loss(n, 0.0);
  for (std::size_t k = 0; k < n; ++k)
    pressure_pa[k] = smooth_bar[k] * units::pa_per_bar;
  model.wall_heat(charge, pressure_pa, burn_from_cad, loss);
  a.net_step_j.assign(n, 0.0);
  a.loss_step_j.assign(n, 0.0);
  for (std::size_t k = 0; k + 1 < n; ++k) {
    double gamma = o.gamma;
    if (o.gamma_source == AnalysisGamma::cylinder) {
      const double mean_k =
          0.5 * (pressure_pa[k] * volume[k] + pressure_pa[k + 1] * volume[k + 1]) / charge.gas_j_per_k;
      gamma = gamma_at(model.cylinder().gas, mean_k);
    }
    if (o.gamma_source == AnalysisGamma::split) {
      gamma = a.angle_cad[k] < burn_from_cad ? o.gamma_compression : o.gamma_combustion;
    }
    a.net_step_j[k + 1] = net_heat(gamma, pressure_pa[k], volume[k], pressure_pa[k + 1], volume[k + 1]);
    a.loss_step_j[k + 1] = loss[k];
  }
}

void require_exponents(const TraceAnalysis& a) {
  if (std::isfinite(a.n_compression) && std::isfinite(a.n_expansion)) return;
  throw about("fractions", DataError("fractions = rassweiler_withrow needs the exponents of compression and expansion, "
                                     "from -100 to -40 and 60 to 120 °CA aTDC: give the whole closed cycle, or take "
                                     "net or gross"));
}

void sum_heat(TraceAnalysis& a, const TraceOptions& o) {
  CumulativeHeat heat = accumulate_heat(a, a.heat_from_cad, a.heat_to_cad);
  if (heat.empty) {
    throw DataError("no sample lies in the heat release window " + text(a.heat_from_cad) + " to " +
                    text(a.heat_to_cad) + " °CA aTDC");
  }
  a.heat_net_j = o.total_at_end ? heat.net_j.sum.back() : heat.net_j.best;
  a.heat_gross_j = o.total_at_end ? heat.gross_j.sum.back() : heat.gross_j.best;
  a.ca10_cad = a.ca50_cad = a.ca90_cad = undefined<double>();
  if (!a.motored) {
    a.ca10_cad = burn_angle_cad(a, heat, o.fractions, 0.1);
    a.ca50_cad = burn_angle_cad(a, heat, o.fractions, 0.5);
    a.ca90_cad = burn_angle_cad(a, heat, o.fractions, 0.9);
  }
  a.heat_net_cumulative_j = std::move(heat.net_j.sum);
  a.heat_gross_cumulative_j = std::move(heat.gross_j.sum);
}

}  // namespace

struct TraceAnalyzer::Shared {
  std::vector<double> angle_cad;  // of the whole trace
  Cylinder cylinder;
  OperatingPoint point;
  TraceOptions options;
  Indicating indicating;
  CycleModel<double> model;
  Smoother smoother;
};

TraceAnalyzer::TraceAnalyzer(const std::vector<double>& angle_cad, const Cylinder& cylinder,
                             const OperatingPoint& point, const TraceOptions& options) {
  validate(cylinder);
  validate(point);
  validate(options);
  TraceOptions figures = options;
  figures.gamma_source = AnalysisGamma::constant;
  Indicating indicating(angle_cad, cylinder, point.speed_rpm, figures);
  const std::vector<double> inside = part(angle_cad, indicating.closed());
  shared_ = std::make_shared<const Shared>(Shared{angle_cad, cylinder, point, options, std::move(indicating),
                                                  CycleModel<double>(cylinder, inside),
                                                  Smoother(inside, point.speed_rpm, options)});
}

TraceAnalysis analyze_trace(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                            const Cylinder& cylinder, const OperatingPoint& point, const TraceOptions& options) {
  check_trace(angle_cad, pressure_bar);
  return TraceAnalyzer(angle_cad, cylinder, point, options)(pressure_bar);
}

TraceAnalysis TraceAnalyzer::operator()(const std::vector<double>& pressure_bar) const {
  const auto& [angle_cad, cylinder, point, options, indicating, model, smoother] = *shared_;
  check_trace(angle_cad, pressure_bar);
  TraceAnalysis a;
  Indicating::Workspace work = indicating.make_workspace();
  static_cast<CycleFigures&>(a) = indicating(pressure_bar.data(), work);
  a.angle_cad = part(angle_cad, indicating.closed());
  a.pressure_bar = part(pressure_bar, indicating.closed());
  for (double& p : a.pressure_bar)
    p += a.pegging_bar;
  require_absolute(a);

  Charge<double> charge = model.charge(point);
  charge.pressure_pa = a.pressure_bar.front() * units::pa_per_bar;
  charge.gas_j_per_k =
      measured_gas_j_per_k<double>(a.angle_cad, a.pressure_bar, model.geometry(), cylinder.geometry.ivc_cad, point);
  a.trapped_mass_g = mass_of_gas_g(charge.gas_j_per_k);
  a.mass_source = point.trapped_mass_g ? "given"
                                       : "p, V, T at IVC with T = " + text(ivc_temperature_k(point)) +
                                             (point.ivc_temperature_k ? " K" : " K, the intake temperature + 40 K");
  describe_gas(a, model, charge.gas_j_per_k);
  refuse_impossible(a, cylinder, point, options);

  a.smoothing = smoother.name();
  const std::vector<double> smooth_bar = smoother(a.pressure_bar);
  const BurnWindow burn = find_burn(a.angle_cad, smooth_bar, a.volume_l, options.earliest_burn_cad);
  const Symmetry strokes = compare_strokes(a.angle_cad, smooth_bar, model.geometry());
  // False where the trace is too short to tell.
  a.motored = strokes.burn_step < (burn.found ? motored_burn_step : motored_burn_step_unseen);
  if (a.motored) a.tdc_offset_cad = strokes.tdc_offset_cad;
  a.window_found = !options.heat_from_cad && burn.found && !a.motored;
  a.heat_from_cad = options.heat_from_cad.value_or(
      a.window_found ? std::max(burn.start_cad - heat_margin_before_cad, a.angle_cad.front()) : idle_heat_from_cad);
  a.heat_to_cad = options.heat_to_cad.value_or(
      a.window_found ? std::min(burn.end_cad + heat_margin_after_cad, a.angle_cad.back()) : idle_heat_to_cad);
  const double burn_from = options.burn_from_cad.value_or(
      options.heat_from_cad.value_or(a.window_found ? burn.start_cad : idle_heat_from_cad));
  release_heat(a, model, charge, smooth_bar, burn_from, options);
  if (options.fractions == BurnFractions::rassweiler_withrow) {
    require_exponents(a);
    a.pressure_step_bar = combustion_pressure_bar(a, smooth_bar);
  }
  sum_heat(a, options);

  add_warnings(a, cylinder, options, burn);
  return a;
}

}  // namespace mgdd::engine
