// Binds optimize/iterative_learning.hpp: the learner; mgdd.optimize.IterativeLearning wraps it.
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/learning/iterative_learning.hpp"

namespace mgdd::bindings {
namespace {

using BoundLearner = Guarded<optimize::IterativeLearning>;
using optimize::ConvergenceReport;
using optimize::IterativeLearning;
using optimize::LearningSettings;

BoundLearner make(const InputArray& initial, const std::string& law, const InputArray& impulse_response,
                  std::optional<int> relative_degree, std::optional<double> k_p, std::optional<double> k_d,
                  const InputArray& learning_function, std::optional<int> lead, std::optional<double> cutoff,
                  std::optional<double> error_weight, std::optional<double> input_weight,
                  std::optional<double> change_weight, double lower, double upper, double rate, bool guard) {
  LearningSettings settings{.initial = to_column(initial, "initial"),
                            .law = parse_name<optimize::LearningLaw>("law", law),
                            .impulse_response = to_column(impulse_response, "impulse_response"),
                            .relative_degree = relative_degree,
                            .k_p = k_p,
                            .k_d = k_d,
                            .learning_function = to_column(learning_function, "learning_function"),
                            .lead = lead,
                            .cutoff = cutoff,
                            .error_weight = error_weight,
                            .input_weight = input_weight,
                            .change_weight = change_weight,
                            .lower = lower,
                            .upper = upper,
                            .rate = rate,
                            .guard = guard};
  const py::gil_scoped_release free_gil;
  return {"IterativeLearning", IterativeLearning(std::move(settings))};
}

py::dict convergence(const BoundLearner& learner) {
  const ConvergenceReport report = [&] {
    const auto held = learner.use();
    const py::gil_scoped_release free_gil;
    return held->convergence();
  }();
  py::dict out;
  out["spectral_radius"] = report.spectral_radius;
  out["radius_is_exact"] = report.radius_is_exact;
  out["sigma_max"] = report.sigma_max;
  out["frequency_gain"] = report.frequency_gain;
  out["worst_frequency"] = report.worst_frequency;
  out["limit_error_map"] = report.asymptotic ? py::cast(report.limit_error_map) : py::none();
  out["limit_error_gain"] = report.limit_error_gain;
  out["asymptotic"] = report.asymptotic;
  out["monotone"] = report.monotone;
  out["sentence"] = report.sentence;
  return out;
}

}  // namespace

void bind_learning(py::module_& m) {
  const LearningSettings d;
  using B = BoundLearner;
  py::class_<B>(m, "IterativeLearning", "Iterative learning control, ask and tell.")
      .def(py::init(&make), py::arg("initial"), py::kw_only(), py::arg("law"), py::arg("impulse_response"),
           py::arg("relative_degree") = py::none(), py::arg("k_p") = py::none(), py::arg("k_d") = py::none(),
           py::arg("learning_function"), py::arg("lead") = py::none(), py::arg("cutoff") = py::none(),
           py::arg("error_weight") = py::none(), py::arg("input_weight") = py::none(),
           py::arg("change_weight") = py::none(), py::arg("lower") = d.lower, py::arg("upper") = d.upper,
           py::arg("rate") = d.rate, py::arg("guard") = d.guard)
      .def(
          "ask",
          [](B& b) {
            const auto learner = b.use();
            const auto input = learner->ask();
            return to_array({input.begin(), input.end()});
          },
          "Input of this trial.")
      .def(
          "tell",
          [](B& b, const InputArray& error) {
            const std::vector<double> column = to_column(error, "error");
            const auto learner = b.use();
            const py::gil_scoped_release free_gil;
            learner->tell(column);
          },
          py::arg("error"), "Error of this trial; makes the next input. Releases the GIL.")
      .def("convergence", &convergence, "Findings of the linear theory, by name. Releases the GIL.")
      .def(
          "state", [](const B& b) { return save_state(*b.use()); }, "Columns by name.")
      .def(
          "restore", [](B& b, const StateColumns& state) { b.use()->restore(state); }, py::arg("state"),
          "Go on from the columns of `state`.")
      .def_property_readonly(
          "trial", [](const B& b) { return b.use()->trial(); }, "Number of the trial to come.")
      .def_property_readonly(
          "frozen", [](const B& b) { return b.use()->frozen(); }, "Whether the guard stopped learning.")
      .def_property_readonly(
          "best_trial", [](const B& b) { return b.use()->best_trial(); }, "Trial of the least error norm.")
      .def_property_readonly(
          "best_norm", [](const B& b) { return b.use()->best_norm(); }, "Its error norm.")
      .def_property_readonly(
          "best_input", [](const B& b) { return to_array(b.use()->best_input()); }, "Its input.")
      .def_property_readonly(
          "error_norms", [](const B& b) { return to_array(b.use()->error_norms()); },
          "Error norms of the latest trials.")
      .def_property_readonly(
          "relative_degree", [](const B& b) { return b.constant().law().relative_degree(); },
          "Samples until an input acts.");
}

}  // namespace mgdd::bindings
