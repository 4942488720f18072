// Binds include/mgdd/loop: a seeker on the bench without the GIL, and many whole loops on all cores.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "bench_columns.hpp"
#include "mgdd/loop/monte_carlo.hpp"
#include "seeker_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace loop;

constexpr std::int64_t cycles_between_looks = 512;

// The interpreter's signal handlers, with the GIL; a raised KeyboardInterrupt becomes "stop" and is cleared.
bool interrupted() {
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() == 0) return false;
  if (PyErr_ExceptionMatches(PyExc_KeyboardInterrupt) == 0) throw py::error_already_set();
  PyErr_Clear();
  return true;
}

struct SummaryField {
  const char* name;
  double (*of)(const LoopSummary&);
};
constexpr SummaryField summary_fields[] = {
    {"final_cad", [](const LoopSummary& s) { return s.final_cad; }},
    {"mean_cad", [](const LoopSummary& s) { return s.mean_cad; }},
    {"rms_cad", [](const LoopSummary& s) { return s.rms_cad; }},
    {"cycles_to", [](const LoopSummary& s) { return s.cycles_to; }},
    {"cycles_stays", [](const LoopSummary& s) { return s.cycles_stays; }},
    {"exceeded_fraction", [](const LoopSummary& s) { return s.exceeded_fraction; }},
    {"mean_applied_cad", [](const LoopSummary& s) { return s.mean_applied_cad; }},
    {"mean_j", [](const LoopSummary& s) { return s.mean_j; }},
    {"mean_efficiency_percent", [](const LoopSummary& s) { return s.mean_efficiency_percent; }},
    {"mean_nox_ppm", [](const LoopSummary& s) { return s.mean_nox_ppm; }},
    {"lowest_cad", [](const LoopSummary& s) { return s.lowest_cad; }},
    {"highest_cad", [](const LoopSummary& s) { return s.highest_cad; }},
    {"misfires", [](const LoopSummary& s) { return static_cast<double>(s.misfires); }}};

LoopCriteria criteria_from(std::int64_t cycles, double optimum_cad, double arrival_cad, std::int64_t tail_cycles,
                           std::optional<std::int64_t> exceed_from, std::vector<double> exceed_above) {
  LoopCriteria out;
  out.optimum_cad = optimum_cad;
  out.arrival_cad = arrival_cad;
  out.tail_cycles = tail_cycles;
  out.exceed_from = exceed_from;
  out.exceed_above = std::move(exceed_above);
  validate(out, cycles);
  return out;
}

template <class S>
py::dict run(EngineBench& bench, Recorded<S>& recorded, std::int64_t cycles, const LoopCriteria& criteria) {
  if (cycles < 1) throw ParameterError("cycles = " + std::to_string(cycles) + ": must be >= 1");
  require_match(bench, recorded.seeker);
  std::vector<BenchCycle> rows;
  std::vector<double> estimate;
  rows.reserve(static_cast<std::size_t>(cycles));
  estimate.reserve(static_cast<std::size_t>(cycles));
  LoopStatistics statistics(criteria, cycles);
  bool stopped = false;
  {
    const py::gil_scoped_release release;
    for (std::int64_t k = 0; k < cycles; ++k) {
      if (k % cycles_between_looks == 0 && (stopped = interrupted())) break;
      const LoopCycle cycle = loop_step(bench, recorded.seeker);
      statistics.add(cycle);
      rows.push_back(cycle.bench);
      estimate.push_back(cycle.estimate_cad);
      const bool fired = !(cycle.bench.misfire || cycle.bench.unphysical);
      recorded.cycle.push_back(static_cast<double>(recorded.seeker.protocol().cycle - 1));
      recorded.applied.push_back(cycle.bench.soc_requested_cad);
      recorded.estimate.push_back(cycle.estimate_cad);
      recorded.objective.push_back(fired ? cycle.bench.j : std::numeric_limits<double>::quiet_NaN());
      recorded.misfire.push_back(fired ? 0.0 : 1.0);
    }
  }
  py::dict out;
  out["columns"] = bench_columns(rows, bench.settings());
  out["estimate_cad"] = to_array(estimate);
  out["interrupted"] = stopped;
  py::dict summary;
  const LoopSummary s = statistics.summary();
  for (const SummaryField& field : summary_fields)
    summary[field.name] = field.of(s);
  out["summary"] = summary;
  return out;
}

template <class S>
void bind_run(py::module_& m) {
  m.def(
      "run_loop",
      [](EngineBench& bench, Recorded<S>& seeker, std::int64_t cycles, double optimum_cad, double arrival_cad,
         std::int64_t tail_cycles, std::optional<std::int64_t> exceed_from, std::vector<double> exceed_above) {
        return run(bench, seeker, cycles,
                   criteria_from(cycles, optimum_cad, arrival_cad, tail_cycles, exceed_from, std::move(exceed_above)));
      },
      py::arg("bench"), py::arg("seeker"), py::arg("cycles"), py::kw_only(), py::arg("optimum_cad"),
      py::arg("arrival_cad"), py::arg("tail_cycles"), py::arg("exceed_from"), py::arg("exceed_above"),
      "Run a seeker on the bench without the GIL; behind mgdd.loop.run_seeker.");
}

template <class S>
bool take(const py::handle& object, std::vector<optimize::Seeker>& into) {
  if (!py::isinstance<Recorded<S>>(object)) return false;
  into.push_back(object.cast<const Recorded<S>&>().seeker);
  return true;
}

void bind_monte_carlo(py::module_& m) {
  m.def(
      "monte_carlo",
      [](const std::vector<EngineBench*>& benches, const py::list& seekers, const std::vector<std::uint64_t>& seeds,
         std::int64_t cycles, const std::vector<double>& optimum_cad, double arrival_cad, std::int64_t tail_cycles,
         std::optional<std::int64_t> exceed_from, const std::vector<std::vector<double>>& exceed_above, int threads) {
        MonteCarloPlan plan;
        for (const EngineBench* bench : benches)
          plan.benches.push_back(*bench);
        if (optimum_cad.size() != benches.size() || exceed_above.size() != benches.size()) {
          throw ShapeError("optimum_cad and exceed_above: give one entry per bench");
        }
        for (std::size_t i = 0; i < benches.size(); ++i) {
          plan.criteria.push_back(
              criteria_from(cycles, optimum_cad[i], arrival_cad, tail_cycles, exceed_from, exceed_above[i]));
        }
        for (const py::handle& object : seekers) {
          if (take<optimize::ExtremumSeeking>(object, plan.seekers) ||
              take<optimize::NewtonSeeking>(object, plan.seekers) ||
              take<optimize::BoundedSeeking>(object, plan.seekers) || take<optimize::Spsa>(object, plan.seekers) ||
              take<optimize::GradientDescent>(object, plan.seekers) ||
              take<optimize::GoldenSection>(object, plan.seekers)) {
            continue;
          }
          throw ParameterError("seekers: " + std::string(py::repr(object)) + " is no seeker of mgdd.optimize");
        }
        plan.seeds = seeds;
        plan.cycles = cycles;
        plan.threads = threads;
        MonteCarloResult result;
        {
          const py::gil_scoped_release release;
          result = monte_carlo(plan, interrupted);
        }
        py::dict out;
        for (const SummaryField& field : summary_fields) {
          std::vector<double> column(result.loops.size());
          std::transform(result.loops.begin(), result.loops.end(), column.begin(), field.of);
          out[field.name] = to_array(column);
        }
        py::array_t<bool> finished(static_cast<py::ssize_t>(result.finished.size()));
        std::copy(result.finished.begin(), result.finished.end(), finished.mutable_data());
        out["finished"] = finished;
        return out;
      },
      py::arg("benches"), py::arg("seekers"), py::arg("seeds"), py::kw_only(), py::arg("cycles"),
      py::arg("optimum_cad"), py::arg("arrival_cad"), py::arg("tail_cycles"), py::arg("exceed_from"),
      py::arg("exceed_above"), py::arg("threads"), "Whole loops on all cores; behind mgdd.loop.monte_carlo.");
}

}  // namespace

void bind_loop(py::module_& m) {
  bind_run<optimize::ExtremumSeeking>(m);
  bind_run<optimize::NewtonSeeking>(m);
  bind_run<optimize::BoundedSeeking>(m);
  bind_run<optimize::Spsa>(m);
  bind_run<optimize::GradientDescent>(m);
  bind_run<optimize::GoldenSection>(m);
  bind_monte_carlo(m);
}

}  // namespace mgdd::bindings
