// Binds include/mgdd/engine: the cycle, its sensitivities and ignition delay.
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cycle_trace.hpp"
#include "mgdd/engine/ignition.hpp"
#include "mgdd/engine/sensitivity.hpp"
#include "mgdd/engine/wall_heat.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

py::dict to_dict(const Indicators<double>& indicators) {
  py::dict out;
  for (const auto& f : indicator_fields<double>())
    out[as_str(f.name)] = indicators.*(f.member);
  return out;
}

// Traces of one cycle; rates belong to the step that ends at the sample, and are zero at the first.
py::dict simulate(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad, double step_cad,
                  const std::string& integrator) {
  const Integrator scheme = parse_name<Integrator>("integrator", integrator);
  const CycleTrace t = without_gil([&] { return trace_cycle(cylinder, point, soc_cad, step_cad, scheme); });
  py::dict out;
  out["indicators"] = to_dict(t.indicators);
  out["trapped_mass_g"] = t.trapped_mass_g;
  out["fuel_heat_j"] = t.fuel_heat_j;
  out["burn_duration_cad"] = t.burn_duration_cad;
  out["crank_angle_cad"] = to_array(t.angle_cad);
  out["pressure_bar"] = to_array(t.pressure_bar);
  out["volume_l"] = to_array(t.volume_l);
  out["temperature_k"] = to_array(t.temperature_k);
  out["burned_fraction"] = to_array(t.burned_fraction);
  out["heat_release_j_per_cad"] = to_array(t.heat_release_j_per_cad);
  out["heat_loss_j_per_cad"] = to_array(t.heat_loss_j_per_cad);
  out["work_booked_j"] = to_array(t.work_booked_j);
  out["energy_change_j"] = to_array(t.energy_change_j);
  return out;
}

// One column per indicator.
py::dict to_columns(const std::vector<Indicators<double>>& rows) {
  py::dict out;
  for (const auto& f : indicator_fields<double>()) {
    std::vector<double> column;
    for (const Indicators<double>& row : rows)
      column.push_back(row.*(f.member));
    out[as_str(f.name)] = to_array(column);
  }
  return out;
}

py::dict scan(const Cylinder& cylinder, const OperatingPoint& point, const InputArray& soc_cad, double step_cad,
              const std::string& integrator) {
  const std::vector<double> timings = to_column(soc_cad, "soc_cad");
  const Integrator scheme = parse_name<Integrator>("integrator", integrator);
  return to_columns(without_gil([&] { return scan_timings(cylinder, point, timings, step_cad, scheme); }));
}

py::dict bind_sensitivities(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                            const std::vector<std::string>& names, double step_cad, const std::string& integrator) {
  const Integrator scheme = parse_name<Integrator>("integrator", integrator);
  const Sensitivities s = without_gil([&] { return sensitivities(cylinder, point, soc_cad, names, step_cad, scheme); });
  py::dict out;
  out["crank_angle_cad"] = to_array(s.angles_cad);
  out["pressure_bar"] = s.pressure_bar;
  out["indicators"] = to_columns(s.indicators);
  out["value"] = to_dict(s.value);
  return out;
}

py::dict bind_convergence(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad, double step_cad,
                          const std::string& integrator) {
  const Integrator scheme = parse_name<Integrator>("integrator", integrator);
  py::dict out;
  for (const auto& e : without_gil([&] { return convergence(cylinder, point, soc_cad, step_cad, scheme); }))
    out[as_str(e.name)] = py::make_tuple(e.value, e.extrapolated, e.error, e.order, as_str(e.unit));
  return out;
}

py::dict to_dict(const IgnitionTiming& t) {
  py::dict out;
  out["soi_cad"] = t.soi_cad;
  out["soc_cad"] = t.soc_cad;
  out["delay_cad"] = t.delay_cad;
  out["ignites"] = t.ignites;
  out["clipped"] = t.clipped;
  return out;
}

}  // namespace

void bind_cycle(py::module_& m) {
  using py::arg;
  m.def("simulate", &simulate, arg("cylinder"), arg("point"), arg("soc_cad"), arg("step_cad"), arg("integrator"),
        "One cycle: traces and indicators.");
  m.def("scan", &scan, arg("cylinder"), arg("point"), arg("soc_cad"), arg("step_cad"), arg("integrator"),
        "Indicators over a column of timings; releases the GIL.");
  m.def("sensitivities", &bind_sensitivities, arg("cylinder"), arg("point"), arg("soc_cad"), arg("names"),
        arg("step_cad"), arg("integrator"), "Exact derivatives of indicators and pressure.");
  m.def("differentiable_inputs", &differentiable_inputs, "Names that `sensitivities` takes.");
  m.def(
      "input_unit", [](const std::string& name) { return std::string(input_unit(name)); }, arg("name"),
      "Unit of a differentiable input.");
  m.def("convergence", &bind_convergence, arg("cylinder"), arg("point"), arg("soc_cad"), arg("step_cad"),
        arg("integrator"), "Step-size error per indicator: (value, extrapolated, error, order, unit).");
  m.def(
      "indicator_units",
      [] {
        py::dict out;
        for (const auto& f : indicator_fields<double>())
          out[as_str(f.name)] = as_str(f.unit);
        return out;
      },
      "Unit of every indicator.");

  m.def(
      "start_of_combustion",
      [](const Cylinder& c, const OperatingPoint& p, double soi) { return to_dict(start_of_combustion(c, p, soi)); },
      arg("cylinder"), arg("point"), arg("soi_cad"), "SOI to SOC.");
  m.def(
      "start_of_injection",
      [](const Cylinder& c, const OperatingPoint& p, double soc) { return to_dict(start_of_injection(c, p, soc)); },
      arg("cylinder"), arg("point"), arg("soc_cad"), "SOC to SOI.");
  m.def("watson_delay_ms", over<&watson_delay_ms>(), arg("pressure_bar"), arg("temperature_k"), "Ignition delay [ms].");
  m.def("wolfer_delay_ms", over<&wolfer_delay_ms>(), arg("pressure_bar"), arg("temperature_k"), "Ignition delay [ms].");
  m.def("hardenberg_hase_delay_cad", over<&hardenberg_hase_delay_cad>(), arg("pressure_bar"), arg("temperature_k"),
        arg("cetane_number"), arg("piston_speed_m_per_s"), "Ignition delay [°CA].");

  m.def(
      "volume_l",
      [](const Cylinder& c, const InputArray& angle) {
        validate(c);
        const Geometry<double> g(c.geometry);
        return elementwise([&g](double a) { return g.volume_m3(a) / units::m3_per_l; }, angle);
      },
      arg("cylinder"), arg("crank_angle_cad"), "Cylinder volume [L].");
  m.def(
      "wall_area_m2",
      [](const Cylinder& c, const InputArray& angle) {
        validate(c);
        const Geometry<double> g(c.geometry);
        return elementwise([&g](double a) { return g.wall_area_m2(g.volume_m3(a)); }, angle);
      },
      arg("cylinder"), arg("crank_angle_cad"), "Wall area [m2].");
  m.def(
      "burned_fraction",
      [](const Cylinder& c, const InputArray& angle, double soc, double duration) {
        validate(c);
        if (!(duration > 0.0)) {
          throw ParameterError("burn_duration_cad", duration, "must be > 0", "°CA");
        }
        const Burn<double> burn(c.burn, soc, duration);
        return elementwise([&burn](double a) { return burn.fraction(a); }, angle);
      },
      arg("cylinder"), arg("crank_angle_cad"), arg("soc_cad"), arg("burn_duration_cad"), "Burned fraction [-].");
  m.def(
      "burn_duration_cad",
      [](const Cylinder& c, const OperatingPoint& p) {
        validate(c);
        validate(p);
        return burn_duration_cad(c.burn, p);
      },
      arg("cylinder"), arg("point"), "Burn duration in force [°CA].");
  m.attr("timing_window_cad") = py::make_tuple(timing_lower_cad, timing_upper_cad);
  m.attr("woschni_c1_bar_m") = woschni_c1_bar_m;
  m.def("woschni_coefficient", over<&woschni_coefficient<double>>(), arg("c1_bar_m"), arg("bore_m"),
        arg("pressure_bar"), arg("temperature_k"), arg("gas_velocity_m_per_s"), "Film coefficient [W/(m2 K)].");
  m.def("hohenberg_coefficient", over<&hohenberg_coefficient<double>>(), arg("c1_bar_m3"), arg("volume_m3"),
        arg("pressure_bar"), arg("temperature_k"), arg("piston_speed_m_per_s"), "Film coefficient [W/(m2 K)].");
  m.def("eichelberg_coefficient", over<&eichelberg_coefficient<double>>(), arg("c1_bar"), arg("pressure_bar"),
        arg("temperature_k"), arg("piston_speed_m_per_s"), "Film coefficient [W/(m2 K)].");
}

}  // namespace mgdd::bindings
