// Binds include/mgdd/identify/throttle: throttle groups. The GIL is released while they run.
#include <array>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "interruptible.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/identify/free_run_fit.hpp"
#include "mgdd/identify/throttle/first_principle_fit.hpp"

namespace mgdd::bindings {
namespace {

using namespace identify;  // NOLINT(google-build-using-namespace): this file binds that room
using throttle::FirstPrinciple;
using Groups = FirstPrincipleGroups;

FirstPrinciple groups_model(double closed_deg, double open_deg, int substeps) {
  FirstPrinciple model;
  model.closed_deg = closed_deg;
  model.open_deg = open_deg;
  model.substeps = substeps;
  return model;
}

// (dt_s, duty, angle_deg, start, skip, free_start) per record.
using RecordTuple =
    std::tuple<double, InputArray, InputArray, std::vector<double>, std::size_t, std::vector<std::size_t>>;
using StageTuple = std::tuple<std::vector<std::size_t>, std::vector<std::size_t>, double, double, int>;

py::dict fit_groups(const std::vector<RecordTuple>& records, const std::vector<StageTuple>& stages,
                    const std::vector<Groups>& starts, double closed_deg, double open_deg, int substeps,
                    std::size_t n_threads) {
  std::vector<SimulationRecord> data;
  for (const auto& [dt_s, duty, angle, start, skip, free_start] : records) {
    SimulationRecord record;
    record.dt_s = dt_s;
    record.input = to_column(duty, "duty");
    record.output = to_column(angle, "angle_deg");
    record.start = start;
    record.skip = skip;
    record.free_start = free_start;
    data.push_back(std::move(record));
  }
  std::vector<FitStage> plan;
  for (const auto& [free, chosen, fraction, cost_tolerance, max_iterations] : stages) {
    FitStage stage{free, chosen, fraction, {}};
    stage.search.cost_tolerance = cost_tolerance;
    stage.search.max_iterations = max_iterations;
    plan.push_back(std::move(stage));
  }
  const FirstPrinciple model = groups_model(closed_deg, open_deg, substeps);
  return hand_over(interruptible([&](const std::stop_token& stop) {
                     for (FitStage& stage : plan)
                       stage.search.stop = stop;
                     return fit_first_principle(model, data, plan, starts, n_threads);
                   }),
                   [](const FirstPrincipleFit& fit) {
                     py::dict result;
                     result["values"] = fit.values;
                     result["reports"] = fit.starts.reports;
                     result["best"] = fit.starts.best;
                     result["n_reached"] = fit.starts.n_reached;
                     return result;
                   });
}

std::vector<double> simulate_groups(const Groups& values, const InputArray& duty, double step_s,
                                    const std::array<double, 3>& start, double closed_deg, double open_deg,
                                    int substeps) {
  const std::vector<double> u = to_column(duty, "duty");
  const FirstPrinciple family = groups_model(closed_deg, open_deg, substeps);
  family.validate();
  const py::gil_scoped_release release;
  return free_run(family, {values.begin(), values.end()}, {start.begin(), start.end()}, u, step_s);
}

}  // namespace

void bind_throttle_fit(py::module_& m) {
  using py::arg;
  std::vector<std::string> group_names;
  for (const FieldInfo& field : FirstPrinciple::parameters)
    group_names.emplace_back(field.name);
  m.attr("group_names") = py::tuple(py::cast(group_names));
  m.def("fit_throttle_groups", &fit_groups, arg("records"), py::kw_only(), arg("stages"), arg("starts"),
        arg("closed_deg"), arg("open_deg"), arg("substeps"), arg("n_threads"),
        "Staged multi-start fit of the throttle groups; releases the GIL.");
  m.def(
      "simulate_throttle_groups",
      [](const Groups& values, const InputArray& duty, double step_s, const std::array<double, 3>& start, double closed,
         double open,
         int substeps) { return to_array(simulate_groups(values, duty, step_s, start, closed, open, substeps)); },
      arg("values"), arg("duty"), py::kw_only(), arg("step_s"), arg("start"), arg("closed_deg"), arg("open_deg"),
      arg("substeps"), "Angle [deg] on every sample; releases the GIL.");
  m.def(
      "throttle_group_bounds",
      [] {
        py::list rows;
        for (const auto& p : first_principle_parameters())
          rows.append(p);
        return rows;
      },
      "The groups with their bounds.");
}

}  // namespace mgdd::bindings
