// Binds engine/trace_analysis.hpp and engine/trace_check.hpp: the analysis of measured pressure.
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/engine/trace_analysis.hpp"
#include "mgdd/engine/trace_check.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

py::dict bind_analyze(const InputArray& angle, const InputArray& pressure, const Cylinder& cylinder,
                      const OperatingPoint& point, const TraceOptions& options) {
  const std::vector<double> angles = to_column(angle, "crank_angle_cad");
  const std::vector<double> pressures = to_column(pressure, "pressure_bar");
  std::optional<py::gil_scoped_release> free_gil(std::in_place);
  const TraceAnalysis a = analyze_trace(angles, pressures, cylinder, point, options);
  free_gil.reset();
  const std::size_t n = a.angle_cad.size();
  const auto per_cad = [&](const std::vector<double>& step_j) {
    std::vector<double> rate(n, 0.0);
    for (std::size_t k = 1; k < n; ++k)
      rate[k] = step_j[k] / (a.angle_cad[k] - a.angle_cad[k - 1]);
    return rate;
  };
  std::vector<double> gross(n);
  for (std::size_t k = 0; k < n; ++k)
    gross[k] = a.heat_net_j[k] + a.heat_loss_j[k];
  py::dict out;
  out["crank_angle_cad"] = to_array(a.angle_cad);
  out["pressure_bar"] = to_array(a.pressure_bar);
  out["volume_l"] = to_array(a.volume_l);
  out["temperature_k"] = to_array(a.temperature_k);
  out["heat_release_net_j_per_cad"] = to_array(per_cad(a.heat_net_j));
  out["heat_release_gross_j_per_cad"] = to_array(per_cad(gross));
  out["heat_loss_j_per_cad"] = to_array(per_cad(a.heat_loss_j));
  out["heat_net_cumulative_j"] = to_array(a.heat_net_cumulative_j);
  out["heat_gross_cumulative_j"] = to_array(a.heat_gross_cumulative_j);
  py::dict scalars;
  scalars["pegging_bar"] = a.pegging_bar;
  scalars["n_compression"] = a.n_compression;
  scalars["n_expansion"] = a.n_expansion;
  scalars["ca10_cad"] = a.ca10_cad;
  scalars["ca50_cad"] = a.ca50_cad;
  scalars["ca90_cad"] = a.ca90_cad;
  scalars["heat_net_j"] = a.heat_net_j_total;
  scalars["heat_gross_j"] = a.heat_gross_j_total;
  scalars["imep_closed_bar"] = a.imep_closed_bar;
  scalars["work_closed_j"] = a.work_closed_j;
  scalars["p_max_bar"] = a.p_max_bar;
  scalars["p_max_cad"] = a.p_max_cad;
  scalars["dp_max_bar_per_cad"] = a.dp_max_bar_per_cad;
  scalars["t_max_k"] = a.t_max_k;
  out["scalars"] = scalars;
  out["motored"] = a.motored;
  out["warnings"] = a.warnings;
  return out;
}

}  // namespace

void bind_trace(py::module_& m) {
  using py::arg;
  const TraceOptions d;
  py::class_<TraceOptions>(m, "TraceOptions")
      .def(py::init([](const std::string& pegging, double exponent, double inlet, const std::string& source,
                       double gamma, double compression, double combustion, double from, double to, double burn,
                       bool end, bool gross) {
             return TraceOptions{parse_pegging(pegging),
                                 exponent,
                                 inlet,
                                 parse_analysis_gamma(source),
                                 gamma,
                                 compression,
                                 combustion,
                                 from,
                                 to,
                                 burn,
                                 end,
                                 gross};
           }),
           py::kw_only(), arg("pegging") = std::string(to_string(d.pegging)),
           arg("pegging_exponent") = d.pegging_exponent, arg("inlet_pressure_kpa") = d.inlet_pressure_kpa,
           arg("gamma_source") = std::string(to_string(d.gamma_source)), arg("gamma") = d.gamma,
           arg("gamma_compression") = d.gamma_compression, arg("gamma_combustion") = d.gamma_combustion,
           arg("heat_from_cad") = d.heat_from_cad, arg("heat_to_cad") = d.heat_to_cad,
           arg("burn_from_cad") = d.burn_from_cad, arg("total_at_end") = d.total_at_end,
           arg("fractions_of_gross") = d.fractions_of_gross);
  m.def("analyze_trace", &bind_analyze, arg("crank_angle_cad"), arg("pressure_bar"), arg("cylinder"), arg("point"),
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
