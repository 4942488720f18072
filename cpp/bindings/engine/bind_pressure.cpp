// Binds engine/trace_analysis.hpp and engine/trace_check.hpp: the analysis of measured pressure.
#include <tuple>
#include <vector>

#include "binding.hpp"
#include "keywords.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

py::dict bind_analyze(const InputArray& angle, const InputArray& pressure, const Cylinder& cylinder,
                      const OperatingPoint& point, const TraceOptions& options) {
  const std::vector<double> angles = to_column(angle, "crank_angle_cad");
  const std::vector<double> pressures = to_column(pressure, "pressure_bar");
  const TraceAnalysis a = without_gil([&] { return analyze_trace(angles, pressures, cylinder, point, options); });
  py::dict out;
  out["crank_angle_cad"] = to_array(a.angle_cad);
  out["pressure_bar"] = to_array(a.pressure_bar);
  out["volume_l"] = to_array(a.volume_l);
  out["temperature_k"] = to_array(a.temperature_k);
  out["heat_release_net_j_per_cad"] = to_array(a.heat_release_net_j_per_cad());
  out["heat_release_gross_j_per_cad"] = to_array(a.heat_release_gross_j_per_cad());
  out["heat_loss_j_per_cad"] = to_array(a.heat_loss_j_per_cad());
  out["heat_net_cumulative_j"] = to_array(a.heat_net_cumulative_j);
  out["heat_gross_cumulative_j"] = to_array(a.heat_gross_cumulative_j);
  py::dict scalars;
  for (const TraceFigure& figure : trace_figures)
    scalars[as_str(figure.name)] = a.*(figure.member);
  out["scalars"] = scalars;
  out["motored"] = a.motored;
  out["warnings"] = a.warnings;
  return out;
}

}  // namespace

void bind_pressure(py::module_& m) {
  using py::arg;
  using O = TraceOptions;
  py::class_<O> options(m, "TraceOptions");
  bind_keywords(
      options,
      std::tuple{choice("pegging", &O::pegging, &parse_pegging), plain("pegging_exponent", &O::pegging_exponent),
                 plain("inlet_pressure_kpa", &O::inlet_pressure_kpa),
                 choice("gamma_source", &O::gamma_source, &parse_analysis_gamma), plain("gamma", &O::gamma),
                 plain("gamma_compression", &O::gamma_compression), plain("gamma_combustion", &O::gamma_combustion),
                 plain("heat_from_cad", &O::heat_from_cad), plain("heat_to_cad", &O::heat_to_cad),
                 plain("burn_from_cad", &O::burn_from_cad), plain("total_at_end", &O::total_at_end),
                 plain("fractions_of_gross", &O::fractions_of_gross)},
      [](const O&) {});
  m.def("analyze", &bind_analyze, arg("crank_angle_cad"), arg("pressure_bar"), arg("cylinder"), arg("point"),
        arg("options"), "Pegging, heat release, burn angles, work.");
  m.def(
      "check_trace",
      [](const InputArray& angle, const InputArray& pressure) {
        const std::vector<double> angles = to_column(angle, "crank_angle_cad");
        const std::vector<double> pressures = to_column(pressure, "pressure_bar");
        const py::gil_scoped_release release;
        check_trace(angles, pressures);
      },
      arg("crank_angle_cad"), arg("pressure_bar"), "DataError unless the trace can be analysed.");
}

}  // namespace mgdd::bindings
