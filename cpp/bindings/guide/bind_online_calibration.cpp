// Binds guide/online_calibration.hpp: the calibration of the cycle model while an engine runs.
#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/guide/online_calibration.hpp"

namespace mgdd::bindings {
namespace {

using namespace guide;
using BoundCalibration = Guarded<OnlineCalibration>;
using Names = std::vector<std::string>;

Names names_where(const std::array<bool, n_calibrated>& chosen) {
  Names names;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (chosen[i]) names.emplace_back(calibrated_parameters[i].field.name);
  }
  return names;
}

py::dict by_name(const CalibrationVector& values) {
  py::dict out;
  for (int i = 0; i < n_calibrated; ++i)
    out[as_str(info_of(i).field.name)] = values[i];
  return out;
}

py::dict settings_of(const OnlineCalibrationSettings& s) {
  py::dict uncertainty;
  for (std::size_t i = 0; i < s.uncertainty.size(); ++i) {
    if (!s.wanted[i]) uncertainty[as_str(calibrated_parameters[i].field.name)] = s.uncertainty[i];
  }
  py::dict out;
  out["cylinder"] = s.cylinder;
  out["method"] = as_str(name_of(s.method));
  out["parameters"] = names_where(s.wanted);
  out["uncertainty"] = uncertainty;
  out["window_cycles"] = s.window.window_cycles;
  out["steady_cycles"] = s.window.steady_cycles;
  out["cov_limit_percent"] = s.window.cov_limit_percent;
  out["forgetting"] = s.forgetting;
  out["soc_scatter_cad"] = s.soc_scatter_cad;
  out["jump_factor"] = s.jump_factor;
  out["trials_per_update"] = s.trials_per_update;
  out["step_cad"] = s.step_cad;
  out["integrator"] = as_str(name_of(s.integrator));
  return out;
}

BoundCalibration make_calibration(const engine::Cylinder& cylinder, const std::string& method, const Names& parameters,
                                  const std::map<std::string, double>& uncertainty, int window_cycles,
                                  int steady_cycles, double cov_limit_percent, double forgetting,
                                  double soc_scatter_cad, double jump_factor, int trials_per_update, double step_cad,
                                  const std::string& integrator) {
  OnlineCalibrationSettings s;
  s.cylinder = cylinder;
  s.method = parse_name<CalibrationMethod>("method", method);
  s.wanted.fill(false);
  for (const std::string& name : parameters)
    s.wanted[static_cast<std::size_t>(parse_calibrated("parameters", name))] = true;
  for (const auto& [name, sd] : uncertainty) {
    const auto at = static_cast<std::size_t>(parse_calibrated("uncertainty", name));
    if (s.wanted[at]) {
      throw about("uncertainty", ParameterError("uncertainty of " + name + " = " + text(sd) +
                                                ": must be left out, nothing is held against an adapted parameter"));
    }
    s.uncertainty[at] = sd;
  }
  s.window = {window_cycles, steady_cycles, cov_limit_percent};
  s.forgetting = forgetting;
  s.soc_scatter_cad = soc_scatter_cad;
  s.jump_factor = jump_factor;
  s.trials_per_update = trials_per_update;
  s.step_cad = step_cad;
  s.integrator = parse_name<engine::Integrator>("integrator", integrator);
  return {"OnlineCalibration", OnlineCalibration(s)};
}

py::dict verdicts(const BoundCalibration& b) {
  const auto calibration = b.use();
  py::dict out;
  for (int i = 0; i < n_calibrated; ++i) {
    if (!calibration->settings().wanted[static_cast<std::size_t>(i)]) continue;
    out[as_str(info_of(i).field.name)] =
        py::make_tuple(as_str(name_of(calibration->verdict(i).knowledge)), calibration->explain(i));
  }
  return out;
}

py::dict figures(const BoundCalibration& b) {
  const auto calibration = b.use();
  py::dict out;
  out["residual_rms_bar"] = calibration->residual_rms_bar();
  out["noise_bar"] = calibration->noise_bar();
  out["effective_samples"] = calibration->effective_samples();
  out["cov_percent"] = calibration->cov_percent();
  out["updates"] = calibration->updates();
  out["accepted"] = calibration->accepted();
  out["jumps"] = calibration->jumps();
  return out;
}

}  // namespace

void bind_online_calibration(py::module_& m) {
  using py::arg;
  m.def(
      "calibrated_parameters",
      [] {
        py::dict out;
        for (const CalibratedInfo& info : calibrated_parameters) {
          out[as_str(info.field.name)] = py::make_tuple(as_str(info.field.unit), as_str(info.field.meaning));
        }
        return out;
      },
      "Unit and meaning of every parameter of an online calibration, by name.");
  py::class_<BoundCalibration>(m, "OnlineCalibration",
                               "Calibration while an engine runs; use mgdd.guide.OnlineCalibration.")
      .def(py::init(&make_calibration), py::kw_only(), arg("cylinder"), arg("method"), arg("parameters"),
           arg("uncertainty"), arg("window_cycles"), arg("steady_cycles"), arg("cov_limit_percent"), arg("forgetting"),
           arg("soc_scatter_cad"), arg("jump_factor"), arg("trials_per_update"), arg("step_cad"), arg("integrator"))
      .def(
          "offer",
          [](BoundCalibration& b, const InputArray& pressure_bar, const engine::OperatingPoint& point, double soc_cad,
             bool misfire) {
            const std::vector<double> pressure = to_column(pressure_bar, "pressure_bar");
            return as_str(name_of(b.use()->offer(pressure, point, soc_cad, misfire)));
          },
          arg("pressure_bar"), arg("point"), arg("soc_cad"), py::kw_only(), arg("misfire") = false,
          "Takes one cycle; the status says what became of it.")
      .def(
          "update", [](BoundCalibration& b) { return as_str(name_of(b.use()->update())); },
          "One step of the calibration; the status says what became of it.")
      .def(
          "restart", [](BoundCalibration& b) { b.use()->restart(); }, "Forget all cycles, keep the parameters.")
      .def_property_readonly("values", [](const BoundCalibration& b) { return by_name(b.use()->parameters()); })
      .def_property_readonly("errors", [](const BoundCalibration& b) { return by_name(b.use()->standard_errors()); })
      .def_property_readonly("verdicts", &verdicts)
      .def_property_readonly("figures", &figures)
      .def_property_readonly(
          "determined", [](const BoundCalibration& b) { return b.use()->determined(); },
          "Whether the data determine every parameter that is adapted.")
      .def_property_readonly(
          "status", [](const BoundCalibration& b) { return as_str(name_of(b.use()->status())); }, "Of the last call.")
      .def_property_readonly(
          "cylinder", [](const BoundCalibration& b) { return b.use()->cylinder(); },
          "The guide's cylinder with the adapted parameters.")
      .def_property_readonly(
          "angles_cad",
          [](const BoundCalibration& b) {
            const auto angles = b.constant().angles_cad();
            return to_array({angles.begin(), angles.end()});
          },
          "Angles that a pressure trace is taken on [°CA aTDC].")
      .def_property_readonly(
          "settings", [](const BoundCalibration& b) { return settings_of(b.constant().settings()); },
          "Constructor keywords as a new dict.")
      .def_property(
          "state", [](const BoundCalibration& b) { return save_state(*b.use()); },
          [](BoundCalibration& b, const StateColumns& state) { restore_state(*b.use(), state); },
          "State between two cycles: named lists of numbers, JSON-able. Setting it continues that run bit for\n"
          "bit; a state of other settings raises ParameterError and changes nothing.");
}

}  // namespace mgdd::bindings
