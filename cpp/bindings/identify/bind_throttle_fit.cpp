// Binds include/mgdd/identify/throttle: smooth throttle, throttle groups. The GIL is released while they run.
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
#include "mgdd/identify/throttle/smooth_fit.hpp"

namespace mgdd::bindings {
namespace {

using namespace identify;  // NOLINT(google-build-using-namespace): this file binds that room
using throttle::FirstPrinciple;
using throttle::SmoothPlant;
using Set = std::array<double, 10>;
using Groups = FirstPrincipleGroups;

template <std::size_t n>
std::vector<std::string> names_of(const std::array<std::string_view, n>& names) {
  return {names.begin(), names.end()};
}

SmoothPlant smooth_plant(double inertia_kgm2, double gear_ratio, double inductance_h, double supply_v) {
  require_positive("inertia_kgm2", inertia_kgm2, "kg m2");
  require_positive("gear_ratio", gear_ratio);
  require_positive("inductance_h", inductance_h, "H");
  require_positive("supply_v", supply_v, "V");
  return {inertia_kgm2, gear_ratio, inductance_h, supply_v};
}

std::vector<double> simulate_smooth(const Set& parameters, const InputArray& duty, double step_s,
                                    const std::array<double, 3>& start, double inertia_kgm2, double gear_ratio,
                                    double inductance_h, double supply_v) {
  const dynamics::Rk4<SmoothPlant> family{smooth_plant(inertia_kgm2, gear_ratio, inductance_h, supply_v), 1};
  const std::vector<double> u = to_column(duty, "duty");
  require_positive("step_s", step_s, "s");
  const py::gil_scoped_release release;
  return free_run(family, {parameters.begin(), parameters.end()}, {start.begin(), start.end()}, u, step_s);
}

py::dict fit_smooth(const InputArray& duty, const InputArray& angle_deg, const std::vector<Set>& starts,
                    const Set& lower, const Set& upper, double step_s, const std::array<double, 3>& start,
                    double inertia_kgm2, double gear_ratio, double inductance_h, double supply_v, double cost_tolerance,
                    bool lanes) {
  const std::vector<double> u = to_column(duty, "duty"), y = to_column(angle_deg, "angle_deg");
  const SmoothPlant plant{inertia_kgm2, gear_ratio, inductance_h, supply_v};
  SmoothThrottleFitOptions options = smooth_throttle_options(throttle::smooth_plant_example);
  options.lower = lower;
  options.upper = upper;
  options.stages.back().cost_tolerance = cost_tolerance;
  options.lanes = lanes;
  return hand_over(interruptible([&](std::stop_token stop) {
                     options.stop = std::move(stop);
                     return fit_smooth_throttle(plant, {step_s, start, u, y}, starts, options);
                   }),
                   [](const SmoothThrottleFit& fit) {
                     py::dict result;
                     result["reports"] = fit.reports;
                     result["best"] = fit.best;
                     result["n_reached"] = fit.n_reached;
                     result["n_sweeps"] = fit.n_sweeps;
                     return result;
                   });
}

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
  m.attr("smooth_names") = py::tuple(py::cast(names_of(SmoothPlant::parameter_names)));
  m.attr("smooth_example") = py::tuple(py::cast(throttle::smooth_plant_example));
  m.attr("group_names") = py::tuple(py::cast(group_names));
  m.def(
      "simulate_smooth_throttle",
      [](const Set& p, const InputArray& duty, double step_s, const std::array<double, 3>& start, double j, double n,
         double l, double v) { return to_array(simulate_smooth(p, duty, step_s, start, j, n, l, v)); },
      arg("parameters"), arg("duty"), py::kw_only(), arg("step_s"), arg("start"), arg("inertia_kgm2"),
      arg("gear_ratio"), arg("inductance_h"), arg("supply_v"), "Angle [deg] on every sample; releases the GIL.");
  m.def("fit_smooth_throttle", &fit_smooth, arg("duty"), arg("angle_deg"), py::kw_only(), arg("starts"), arg("lower"),
        arg("upper"), arg("step_s"), arg("start"), arg("inertia_kgm2"), arg("gear_ratio"), arg("inductance_h"),
        arg("supply_v"), arg("cost_tolerance"), arg("lanes"),
        "Staged fit of the ten parameters from every start; releases the GIL.");
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
