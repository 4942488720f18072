// Binds include/mgdd/loop: a seeker on the bench without the GIL, and many whole loops on all cores.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "guide/guided_binding.hpp"
#include "interruptible.hpp"
#include "loop/bench_columns.hpp"
#include "loop/function_plant_binding.hpp"
#include "mgdd/loop/cycle_fields.hpp"
#include "mgdd/loop/monte_carlo.hpp"
#include "mgdd/loop/run_loop.hpp"
#include "optimize/seeker_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace loop;

std::string column_name(std::string_view figure, const std::string& limit) {
  return std::string(figure) + "_" + limit;
}

py::dict to_dict(const LoopRun& run, const BenchSettings& settings) {
  std::vector<BenchCycle> rows;
  std::vector<double> estimate;
  for (const LoopCycle& cycle : run.cycles) {
    rows.push_back(cycle.bench);
    estimate.push_back(cycle.estimate_cad);
  }
  py::dict summary;
  for (const auto& number : loop_summary_numbers)
    summary[as_str(number.name)] = number.of(run.summary);
  for (std::size_t i = 0; i < settings.limits.size(); ++i) {
    for (const auto& number : limit_figure_numbers)
      summary[py::str(column_name(number.name, settings.limits[i]))] = number.of(run.summary.limits[i]);
  }
  py::dict out;
  out["columns"] = bench_columns(rows, settings);
  out["estimate_cad"] = to_array(estimate);
  out["interrupted"] = run.stopped;
  out["summary"] = summary;
  return out;
}

template <class S>
py::dict run(BoundBench& bound_bench, BoundSeeker<S>& bound_seeker, std::int64_t cycles, double optimum_cad,
             double arrival_cad, std::int64_t tail_cycles, std::optional<std::int64_t> exceed_from,
             const std::vector<double>& exceed_above, const std::vector<double>& limits) {
  const LoopCriteria criteria{optimum_cad, arrival_cad, tail_cycles, exceed_from, exceed_above, limits};
  py::dict seen;  // before another call can take the seeker
  auto outcome = [&] {
    const auto bench = bound_bench.use();
    const auto seeker = bound_seeker.use();
    auto run =
        interruptible([&](const std::stop_token& stop) { return run_loop(*bench, *seeker, cycles, criteria, stop); });
    seen = watched(*seeker);
    return run;
  }();
  return hand_over(std::move(outcome), [&](const LoopRun& done) {
    py::dict out = to_dict(done, bound_bench.constant().settings());
    out["watched"] = seen;
    return out;
  });
}

template <class S>
std::int64_t run_function(BoundFunctionPlant& bound_plant, BoundSeeker<S>& bound_seeker, std::int64_t cycles) {
  const auto plant = bound_plant.use();
  const auto seeker = bound_seeker.use();
  return hand_over(interruptible([&](const std::stop_token& stop) { return run_loop(*plant, *seeker, cycles, stop); }));
}

template <class S>
void bind_run(py::module_& m) {
  m.def("run_function", &run_function<S>, py::arg("plant"), py::arg("seeker"), py::arg("cycles"),
        "Run a seeker on a function without the GIL: how many cycles were run.");
  m.def("run_loop", &run<S>, py::arg("bench"), py::arg("seeker"), py::arg("cycles"), py::kw_only(),
        py::arg("optimum_cad"), py::arg("arrival_cad"), py::arg("tail_cycles"), py::arg("exceed_from"),
        py::arg("exceed_above"), py::arg("limits"),
        "Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.");
}

py::dict to_dict(const MonteCarloResult& result, const std::vector<std::string>& limit_names) {
  py::dict out;
  std::vector<double> column(result.loops.size());
  for (const auto& number : loop_summary_numbers) {
    std::ranges::transform(result.loops, column.begin(), number.of);
    out[as_str(number.name)] = to_array(column);
  }
  for (std::size_t i = 0; i < limit_names.size(); ++i) {
    for (const auto& number : limit_figure_numbers) {
      std::ranges::transform(result.loops, column.begin(),
                             [&](const LoopSummary& loop) { return number.of(loop.limits[i]); });
      out[py::str(column_name(number.name, limit_names[i]))] = to_array(column);
    }
  }
  py::array_t<bool> finished(static_cast<py::ssize_t>(result.finished.size()));
  std::copy(result.finished.begin(), result.finished.end(), finished.mutable_data());
  out["finished"] = finished;
  return out;
}

/// A copy of what Python holds, without its record.
LoopSeeker loop_seeker_of(const py::handle& object) {
  if (py::isinstance<BoundGuidedEngine>(object)) return *object.cast<const BoundGuidedEngine&>().use();
  if (py::isinstance<BoundFeedForward>(object)) {
    const auto core = object.cast<const BoundFeedForward&>().use();
    return guide::ScheduledFeedForward(core->around(core->seeker().seeker()));
  }
  return std::visit([](auto&& seeker) -> LoopSeeker { return std::forward<decltype(seeker)>(seeker); },
                    seeker_of<Seeker>(object, "seekers"));
}

/// First cycle, end, optimum, curvature and cause of what a guide said; without an optimum it said nothing.
using Answer =
    std::tuple<std::int64_t, std::int64_t, std::optional<std::vector<double>>, std::vector<double>, std::string>;

std::vector<guide::GuideAnswer> answers_from(const std::vector<Answer>& given) {
  std::vector<guide::GuideAnswer> out;
  for (const auto& [first, end, optimum, curvature, cause] : given) {
    guide::GuideAnswer& said = out.emplace_back();
    said.first = first;
    said.end = end;
    if (optimum) said.value = guide_value_from(*optimum, curvature);
    said.cause = parse_name<guide::GuideCause>("cause", cause);
  }
  return out;
}

template <class Plant>
py::dict seek_many(const std::vector<Guarded<Plant>*>& benches, const py::list& seekers,
                   const std::vector<std::uint64_t>& seeds, const std::vector<std::vector<Answer>>& answers,
                   std::int64_t cycles, const std::vector<double>& optimum_cad, double arrival_cad,
                   std::int64_t tail_cycles, std::optional<std::int64_t> exceed_from,
                   const std::vector<std::vector<double>>& exceed_above, const std::vector<std::vector<double>>& limits,
                   int threads, const std::string& form) {
  if (optimum_cad.size() != benches.size() || exceed_above.size() != benches.size() ||
      limits.size() != benches.size()) {
    throw ShapeError("optimum_cad, exceed_above and limits: give one entry per bench");
  }
  MonteCarloPlanOf<Plant> plan;
  for (std::size_t i = 0; i < benches.size(); ++i) {
    plan.benches.push_back(*benches[i]->use());
    plan.criteria.push_back({optimum_cad[i], arrival_cad, tail_cycles, exceed_from, exceed_above[i], limits[i]});
  }
  for (const py::handle& object : seekers)
    plan.seekers.push_back(loop_seeker_of(object));
  for (const std::vector<Answer>& said : answers)
    plan.answers.push_back(answers_from(said));
  plan.seeds = seeds;
  plan.cycles = cycles;
  plan.threads = threads;
  plan.form = parse_name<engine::BatchForm>("form", form);
  return hand_over(
      interruptible([&plan](const std::stop_token& stop) {
        return monte_carlo(plan, [&stop] { return stop.stop_requested(); });
      }),
      [&plan](const MonteCarloResult& result) { return to_dict(result, plan.benches.front().settings().limits); });
}

template <class Plant>
void bind_many(py::module_& m) {
  m.def("monte_carlo", &seek_many<Plant>, py::arg("benches"), py::arg("seekers"), py::arg("seeds"), py::arg("answers"),
        py::kw_only(), py::arg("cycles"), py::arg("optimum_cad"), py::arg("arrival_cad"), py::arg("tail_cycles"),
        py::arg("exceed_from"), py::arg("exceed_above"), py::arg("limits"), py::arg("threads"),
        py::arg("form") = "automatic", "Whole loops on all cores; behind mgdd.loop.monte_carlo.");
}

template <class... S>
void bind_runs(py::module_& m, const std::variant<S...>*) {
  (bind_run<S>(m), ...);
}

}  // namespace

void bind_loop(py::module_& m) {
  bind_runs(m, static_cast<const Seeker*>(nullptr));
  bind_many<VirtualEngine>(m);
  bind_many<FunctionPlant>(m);
  m.def(
      "loop_form", [](std::size_t loops) { return std::string(name_of(form_of_loops(loops, LoopForm::automatic))); },
      py::arg("loops"), "Form that so many loops take; who cuts them into pieces passes it on.");
}

}  // namespace mgdd::bindings
