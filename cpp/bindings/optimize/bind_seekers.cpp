// Binds include/mgdd/optimize: extremum seeking, SPSA, gradient descent, golden section, surfaces, Gaussian processes.
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_settings.hpp"

namespace mgdd::bindings {
namespace {

using namespace optimize;

void bind_extremum_seeking(py::module_& m) {
  using B = BoundSeeker<ExtremumSeeking>;
  py::class_<B> cls(m, "ExtremumSeeking", "Extremum seeking; see mgdd.optimize.ExtremumSeeking.");
  bind_settings<ExtremumSeeking>(cls, "ExtremumSeeking");
  cls.def_property_readonly(
         "amplitude_share", [](const B& b) { return b.use()->seeker().amplitude_share(); },
         "Amplitude now over that of the settings.")
      .def_property_readonly(
          "gain", [](const B& b) { return list_or_none(b.use()->seeker().gain()); },
          "Gain in use, per input; None while the first readings are taken.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_spsa(py::module_& m) {
  using B = BoundSeeker<Spsa>;
  py::class_<B> cls(m, "Spsa", "Simultaneous perturbation; see mgdd.optimize.Spsa.");
  bind_settings<Spsa>(cls, "Spsa");
  cls.def_property_readonly(
         "hessian", [](const B& b) { return Eigen::MatrixXd(b.use()->seeker().hessian()); },
         "Averaged Hessian of the second-order form, shape (inputs, inputs).")
      .def_property_readonly(
          "iteration", [](const B& b) { return b.use()->seeker().iteration(); },
          "Iterations since the start or restart.")
      .def_property_readonly(
          "gain", [](const B& b) { return list_or_none(b.use()->seeker().gain()); },
          "Gain in use, per input; None while the first readings are taken.")
      .def_property_readonly(
          "blocked", [](const B& b) { return b.use()->seeker().blocked(); }, "Steps that blocking refused.")
      .def_property_readonly(
          "measurements_per_iteration", [](const B& b) { return b.constant().seeker().measurements_per_iteration(); },
          "Cycles that one iteration takes.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_gradient_descent(py::module_& m) {
  using B = BoundSeeker<GradientDescent>;
  py::class_<B> cls(m, "GradientDescent", "Two-sided differences; see mgdd.optimize.GradientDescent.");
  bind_settings<GradientDescent>(cls, "GradientDescent");
  cls.def_property_readonly(
         "iteration", [](const B& b) { return b.use()->seeker().iteration(); }, "Steps made.")
      .def_property_readonly(
          "step_size", [](const B& b) { return list_or_none(b.use()->seeker().step_size()); },
          "Step size in use, per input; None while the first readings are taken.")
      .def_property_readonly(
          "converged_at",
          [](const B& b) {
            const std::int64_t at = b.use()->seeker().converged_at();
            return at < 0 ? std::nullopt : std::optional(at);
          },
          "Step at which the tolerance was met first, or None.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_golden_section(py::module_& m) {
  using B = BoundSeeker<GoldenSection>;
  py::class_<B> cls(m, "GoldenSection", "Golden-section search; see mgdd.optimize.GoldenSection.");
  bind_settings<GoldenSection>(cls, "GoldenSection");
  cls.def_property_readonly(
         "bracket",
         [](const B& b) {
           const auto r = b.use();
           return std::pair(r->seeker().lower(), r->seeker().upper());
         },
         "Present bracket, lower and upper end.")
      .def_property_readonly(
          "converged", [](const B& b) { return b.use()->seeker().converged(); },
          "Whether the bracket is as small as tolerance or noise allow.");
  bind_seeking(cls);
}

std::vector<std::vector<double>> axes_from(const py::sequence& given) {
  std::vector<std::vector<double>> axes;
  for (const py::handle& axis : given)
    axes.push_back(to_column(axis.cast<InputArray>(), "axes[" + std::to_string(axes.size()) + "]"));
  return axes;
}

void bind_surface(py::module_& m) {
  py::class_<Surface>(m, "Surface", "Behind guide= of mgdd.optimize.GaussianProcessSeeking: a table over a grid.")
      .def(py::init([](const py::sequence& axes, const InputArray& values) {
             return Surface(axes_from(axes), {values.data(), values.data() + values.size()});
           }),
           py::arg("axes"), py::arg("values"))
      .def(
          "__call__",
          [](const Surface& s, const InputArray& at) {
            const auto n = static_cast<Eigen::Index>(s.axes().size());
            if (at.size() != n) throw ShapeError("at has " + std::to_string(at.size()) + " entries: one per axis");
            return s(Inputs(Eigen::Map<const Eigen::VectorXd>(at.data(), n)));
          },
          py::arg("at"), "Value at one point; the edge holds outside of the grid.")
      .def_property_readonly("axes", &Surface::axes, "Of the grid, one per input.")
      .def_property_readonly(
          "values",
          [](const Surface& s) {
            std::vector<py::ssize_t> shape;
            for (const auto& axis : s.axes())
              shape.push_back(static_cast<py::ssize_t>(axis.size()));
            return py::array_t<double>(shape, s.values().data());
          },
          "At its nodes, shape of the axes.")
      .def("__eq__",
           [](const Surface& s, const py::object& other) {
             return py::isinstance<Surface>(other) && s == other.cast<const Surface&>();
           })
      .def(py::pickle([](const Surface& s) { return py::make_tuple(1, s.axes(), s.values()); },
                      [](const py::tuple& state) {
                        require_pickle_version(state);
                        return Surface(state[1].cast<std::vector<std::vector<double>>>(),
                                       state[2].cast<std::vector<double>>());
                      }));
}

void bind_gaussian_process(py::module_& m) {
  using B = BoundSeeker<GaussianProcessSeeking>;
  py::class_<B> cls(m, "GaussianProcessSeeking", "By Gaussian processes; see mgdd.optimize.GaussianProcessSeeking.");
  bind_settings<GaussianProcessSeeking>(cls, "GaussianProcessSeeking");
  cls.def_property_readonly(
         "noise_sd", [](const B& b) { return b.use()->seeker().noise_sd(); },
         "Standard deviation of one reading of J, as learnt.")
      .def_property_readonly(
          "expected", [](const B& b) { return b.use()->seeker().expected(); },
          "J that is expected at the estimate; 0 before there are readings enough.")
      .def_property_readonly(
          "expected_sd", [](const B& b) { return b.use()->seeker().expected_sd(); },
          "Standard deviation of that expectation, without the noise of a reading.")
      .def_property_readonly(
          "doubts", [](const B& b) { return b.use()->seeker().doubts(); },
          "How often the readings were not what the process expects, and what was known was aged.")
      .def_property_readonly(
          "trust", [](const B& b) { return b.use()->seeker().trust(); },
          "Least share of the bends of J that a guide holds, as learnt: above 0.5 where it helps, towards 0 where it "
          "says nothing; 1 without a guide.")
      .def_property_readonly(
          "guide_factor",
          [](const B& b) {
            const auto r = b.use();
            py::list out;
            const auto& guides = b.constant().settings().guide;
            for (std::size_t i = 0; i < guides.size(); ++i) {
              if (guides[i].empty()) out.append(py::none());
              if (!guides[i].empty()) out.append(r->seeker().guide_factor(i));
            }
            return out;
          },
          "What the guide of each component is multiplied by, as learnt: about 1 where it is right, towards 0 where it "
          "says nothing.")
      .def_property_readonly(
          "delay_cycles",
          [](const B& b) -> py::object {
            const auto r = b.use();
            if (r->component_count() == 1) return py::float_(r->seeker().delay_cycles());
            py::list out;
            for (std::size_t i = 0; i < r->component_count(); ++i)
              out.append(r->seeker().delay_cycles(i));
            return out;
          },
          "Cycles between input and reading of J that explain the readings best; of several components a list.");
  bind_seeking(cls);
}

}  // namespace

void bind_seekers(py::module_& m) {
  bind_extremum_seeking(m);
  bind_spsa(m);
  bind_gradient_descent(m);
  bind_golden_section(m);
  bind_surface(m);
  bind_gaussian_process(m);
}

}  // namespace mgdd::bindings
