// Binds the measured-benchmark models of cpp/systems: drive axis, two tanks, Wiener-Hammerstein.
#include <map>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "interruptible.hpp"
#include "mgdd/identify/free_run_fit.hpp"
#include "systems/drive_axis.hpp"
#include "systems/two_tanks.hpp"
#include "systems/wiener_hammerstein.hpp"

namespace mgdd::bindings {
namespace {

using namespace identify;
using namespace systems;
using py::arg;

struct InputRecord {
  std::vector<double> input, output, start;
  std::vector<std::string> free_start;
  std::size_t skip;
};

template <class Fields>
std::vector<std::string> field_names(const Fields& fields) {
  std::vector<std::string> names;
  for (const FieldInfo& field : fields)
    names.emplace_back(field.name);
  return names;
}

template <class Model>
void bind_family(py::class_<Model>& cls) {
  cls.def_property_readonly_static("parameter_names", [](const py::object&) { return field_names(Model::parameters); });
  cls.def_property_readonly_static("state_names", [](const py::object&) { return field_names(Model::start_numbers); });
  cls.def(
      "free_run",
      [](const Model& model, const std::vector<double>& parameters, const std::vector<double>& start,
         const InputArray& input, double dt_s) {
        const std::vector<double> column = to_column(input, "input");
        return to_array(without_gil([&] { return free_run(model, parameters, start, column, dt_s); }));
      },
      py::kw_only(), arg("parameters"), arg("start"), arg("input"), arg("dt_s"), "Output at every sample.");
  cls.def(
      "fit",
      [](const Model& model, const std::vector<double>& base, const std::vector<std::string>& free,
         const std::vector<InputRecord>& inputs, double dt_s, optimize::LeastSquaresOptions options) {
        std::vector<SimulationRecord> records;
        for (const InputRecord& in : inputs) {
          SimulationRecord record;
          record.dt_s = dt_s;
          record.input = in.input;
          record.output = in.output;
          record.start = in.start;
          record.skip = in.skip;
          for (const std::string& name : in.free_start)
            record.free_start.push_back(field_index(Model::start_numbers, name, "state"));
          records.push_back(std::move(record));
        }
        return hand_over(interruptible([&](std::stop_token stop) {
          options.stop = std::move(stop);
          return fit_free_run(model, base, free, std::move(records), options);
        }));
      },
      py::kw_only(), arg("base"), arg("free"), arg("records"), arg("dt_s"), arg("options"),
      "Levenberg-Marquardt on the free run with exact sensitivities; releases the GIL.");
}

}  // namespace

void bind_benchmark_models(py::module_& m) {
  py::class_<InputRecord>(m, "FreeRunRecord", "One measured record, its start and what of the start is unknown.")
      .def(py::init([](const InputArray& input, const InputArray& output, std::vector<double> start,
                       std::vector<std::string> free_start, std::size_t skip) {
             return InputRecord{to_column(input, "input"), to_column(output, "output"), std::move(start),
                                std::move(free_start), skip};
           }),
           py::kw_only(), arg("input"), arg("output"), arg("start"), arg("free_start") = std::vector<std::string>{},
           arg("skip") = 0);

  py::class_<FreeRunFit>(m, "FreeRunFit", "What a free-run fit hands back.")
      .def_readonly("report", &FreeRunFit::report)
      .def_readonly("parameters", &FreeRunFit::parameters)
      .def_readonly("starts", &FreeRunFit::starts)
      .def_property_readonly("outputs", [](const FreeRunFit& fit) {
        py::list outputs;
        for (const std::vector<double>& output : fit.outputs)
          outputs.append(to_array(output));
        return outputs;
      });

  py::class_<DriveAxis> axis(m, "DriveAxis", "Motor-driven axis with friction.");
  axis.def(py::init([](double force_n_per_v, double centre_m) { return DriveAxis{force_n_per_v, centre_m}; }),
           py::kw_only(), arg("force_n_per_v"), arg("centre_m") = 0.0);
  bind_family(axis);

  py::class_<TwoTanks> tanks(m, "TwoTanks", "Two tanks in a row with overflow.");
  tanks.def(py::init([](double lower_brim_v) {
              TwoTanks model;
              model.lower_brim_v = lower_brim_v;
              return model;
            }),
            py::kw_only(), arg("lower_brim_v"));
  bind_family(tanks);

  py::class_<WienerHammerstein>(m, "WienerHammerstein", "Filter, static curve, filter.")
      .def(py::init([](int first_order, int last_order, int n_curve, double lower, double upper) {
             const WienerHammerstein model{first_order, last_order, n_curve, lower, upper};
             model.validate();
             return model;
           }),
           py::kw_only(), arg("first_order"), arg("last_order"), arg("n_curve"), arg("lower"), arg("upper"))
      .def_readonly("lower", &WienerHammerstein::lower)
      .def_readonly("upper", &WienerHammerstein::upper)
      .def_property_readonly("names", &WienerHammerstein::names)
      .def("simulate", &WienerHammerstein::simulate, arg("parameters"), arg("input"),
           py::call_guard<py::gil_scoped_release>(), "Response from rest.")
      .def("curve", &WienerHammerstein::curve, arg("parameters"), arg("x"), py::call_guard<py::gil_scoped_release>(),
           "The static curve.")
      .def(
          "fit",
          [](const WienerHammerstein& model, const Eigen::VectorXd& start, const Eigen::VectorXd& input,
             const Eigen::VectorXd& output, Eigen::Index skip, optimize::LeastSquaresOptions options) {
            return hand_over(interruptible([&](std::stop_token stop) {
              options.stop = std::move(stop);
              return fit_wiener_hammerstein(model, start, input, output, skip, options);
            }));
          },
          py::kw_only(), arg("start"), arg("input"), arg("output"), arg("skip"), arg("options"),
          "Levenberg-Marquardt on the response with exact derivatives; releases the GIL.");
  m.def("filter_series", &filter_series, arg("b"), arg("a"), arg("u"), py::call_guard<py::gil_scoped_release>(),
        "B/A u from rest.");
}

}  // namespace mgdd::bindings
