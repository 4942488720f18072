// Binds guide/model_optimum.hpp: the best timing of the cycle model in bounded time.
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/guide/model_optimum.hpp"

namespace mgdd::bindings {
namespace {

using BoundOptimum = Guarded<guide::ModelOptimum>;

BoundOptimum make_optimum(const engine::Cylinder& cylinder, const engine::Performance& performance,
                          const engine::NoxModel& nox, const std::string& method, std::pair<double, double> bounds_cad,
                          double step_size, double difference_cad, double tolerance_cad, std::int64_t iterations,
                          double step_cad, const std::string& integrator) {
  guide::ModelOptimumSettings s;
  s.cylinder = cylinder;
  s.performance = performance;
  s.nox = nox;
  s.method = parse_name<guide::OptimumMethod>("method", method);
  std::tie(s.lower_cad, s.upper_cad) = bounds_cad;
  s.step_size = step_size;
  s.difference_cad = difference_cad;
  s.tolerance_cad = tolerance_cad;
  s.iterations = iterations;
  s.step_cad = step_cad;
  s.integrator = parse_name<engine::Integrator>("integrator", integrator);
  return {"ModelOptimum", guide::ModelOptimum(s)};
}

py::dict to_dict(const guide::ModelOptimumSettings& s) {
  py::dict out;
  out["performance"] = s.performance;
  out["nox"] = s.nox;
  out["method"] = as_str(name_of(s.method));
  out["bounds_cad"] = py::make_tuple(s.lower_cad, s.upper_cad);
  out["step_size"] = s.step_size;
  out["difference_cad"] = s.difference_cad;
  out["tolerance_cad"] = s.tolerance_cad;
  out["iterations"] = s.iterations;
  out["step_cad"] = s.step_cad;
  out["integrator"] = as_str(name_of(s.integrator));
  return out;
}

}  // namespace

void bind_model_optimum(py::module_& m) {
  using py::arg;
  py::class_<BoundOptimum> cls(m, "ModelOptimum", "Best timing of the cycle model; see mgdd.guide.ModelOptimum.");
  cls.def(py::init(&make_optimum), arg("cylinder"), py::kw_only(), arg("performance"), arg("nox"), arg("method"),
          arg("bounds_cad"), arg("step_size"), arg("difference_cad"), arg("tolerance_cad"), arg("iterations"),
          arg("step_cad"), arg("integrator"));
  cls.def(
      "_find",
      [](BoundOptimum& b, const engine::OperatingPoint& point) {
        const guide::ModelOptimumResult found = b.use()->find(point);
        py::dict out;
        out["found"] = found.found;
        out["soc_cad"] = found.soc_cad;
        out["j"] = found.j;
        out["curvature"] = found.curvature;
        out["at_bound"] = found.at_bound;
        out["method"] = as_str(name_of(found.method));
        out["iterations"] = found.iterations;
        return out;
      },
      arg("point"), "The search at one operating point.");
  cls.def(
      "_curves",
      [](BoundOptimum& b, const engine::OperatingPoint& point,
         const std::vector<std::string>& names) -> std::optional<std::vector<guide::Curve>> {
        std::vector<double engine::Indicators<double>::*> members;
        for (const std::string& name : names) {
          for (const auto& field : engine::indicator_fields<double>()) {
            if (field.name == name) members.push_back(field.member);
          }
        }
        if (members.size() != names.size()) return std::nullopt;
        std::vector<guide::Curve> out(names.size() + 1);
        if (!b.use()->tabulate(point, out.front(), members, std::span(out).subspan(1))) return std::nullopt;
        return out;
      },
      arg("point"), arg("names"),
      "J and indicators over SOC at one operating point; None where the model has no physical cycle.");
  cls.def(
      "_set_cylinder", [](BoundOptimum& b, const engine::Cylinder& cylinder) { b.use()->set_cylinder(cylinder); },
      arg("cylinder"), "Other parameters of the same geometry.");
  cls.def_property_readonly(
      "cylinder", [](const BoundOptimum& b) { return b.use()->settings().cylinder; }, "The model at present.");
  cls.def_property_readonly(
      "settings", [](const BoundOptimum& b) { return to_dict(b.constant().settings()); },
      "Keyword arguments that, with `cylinder`, make this guide again.");
}

}  // namespace mgdd::bindings
