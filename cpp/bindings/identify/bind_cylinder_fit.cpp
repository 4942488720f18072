// Binds include/mgdd/identify: the calibration of the cycle model to measured traces.
#include <map>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "interruptible.hpp"
#include "mgdd/identify/engine/cylinder_fit.hpp"

namespace mgdd::bindings {

void bind_cylinder_fit(py::module_& m) {
  using namespace identify;
  using py::arg;

  py::class_<MeasuredCycle>(m, "MeasuredCycle")
      .def(py::init([](std::string label, const InputArray& angle, const InputArray& pressure,
                       const engine::OperatingPoint& point) {
             return MeasuredCycle{std::move(label), to_column(angle, "crank_angle_cad"),
                                  to_column(pressure, "pressure_bar"), point};
           }),
           py::kw_only(), arg("label"), arg("crank_angle_cad"), arg("pressure_bar"), arg("point"));

  py::class_<LoadBurn> burn(m, "LoadBurn");
  burn.def(py::init<>());
  for (const auto& f : load_fields<double>()) {
    burn.def_property(
        f.info.name.data(), [f](const LoadBurn& b) { return f.in(b); },
        [f](LoadBurn& b, double value) { f.in(b) = value; });
  }

  py::class_<LoadFit>(m, "LoadFit")
      .def_property_readonly("burn", [](const LoadFit& l) { return l.burn; })
      .def_property_readonly("model_bar", [](const LoadFit& l) { return to_array(l.model_bar); })
      .def_readonly("p_max_bar", &LoadFit::p_max_bar)
      .def_readonly("rmse_bar", &LoadFit::rmse_bar)
      .def_readonly("rmse_percent", &LoadFit::rmse_percent)
      .def_readonly("imep_closed_bar", &LoadFit::imep_closed_bar)
      .def_readonly("imep_closed_model_bar", &LoadFit::imep_closed_model_bar)
      .def_readonly("imep_closed_error_percent", &LoadFit::imep_closed_error_percent)
      .def_readonly("largest_error_bar", &LoadFit::largest_error_bar)
      .def_readonly("largest_error_cad", &LoadFit::largest_error_cad)
      .def_readonly("ca50_cad", &LoadFit::ca50_cad)
      .def_readonly("heat_loss_fraction", &LoadFit::heat_loss_fraction)
      .def_readonly("trapped_mass_g", &LoadFit::trapped_mass_g);

  py::class_<CylinderFit>(m, "CylinderFit")
      .def_property_readonly("cylinder", [](const CylinderFit& f) { return f.cylinder; })
      .def_property_readonly("loads", [](const CylinderFit& f) { return f.loads; })
      .def_property_readonly("correlation_if_free", [](const CylinderFit& f) { return f.correlation_if_free; })
      .def_property_readonly("report", [](const CylinderFit& f) { return f.report; });

  m.attr("wall_heat_scale_upper") = wall_heat_scale_upper;
  m.attr("correlation_limit") = optimize::LeastSquaresOptions{}.correlation_limit;
  m.def("load_parameters", &load_parameters, "Names that may be freed per load.");
  m.def("common_parameters", &common_parameters, "Cylinder fields that may be freed for all loads.");
  m.def("estimate_burn", &estimate_burn, arg("trace"), arg("cylinder"), py::call_guard<py::gil_scoped_release>(),
        "A start from the trace's heat release.");
  m.def("with_burn", &with_burn<double>, arg("cylinder"), arg("burn"), "The cylinder with one load's shape fields.");
  m.def(
      "fit_cylinder",
      [](const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder, const std::vector<LoadBurn>& start,
         const std::vector<std::string>& free, double step_cad, const std::string& integrator, int max_iterations,
         const std::map<std::string, std::pair<double, double>>& bounds) {
        CylinderFitOptions options;
        for (const auto& [name, range] : bounds)
          options.bounds.push_back({name, range.first, range.second});
        options.step_cad = step_cad;
        options.integrator = parse_name<engine::Integrator>("integrator", integrator);
        options.search.max_iterations = max_iterations;
        return hand_over(interruptible([&](std::stop_token stop) {
          options.search.stop = std::move(stop);
          return fit_cylinder(traces, cylinder, start, free, options);
        }));
      },
      arg("traces"), arg("cylinder"), arg("start"), arg("free"), arg("step_cad"), arg("integrator"),
      arg("max_iterations"), arg("bounds"), "Levenberg-Marquardt with exact sensitivities; releases the GIL.");
}

}  // namespace mgdd::bindings
