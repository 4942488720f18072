// Binds include/mgdd/guide: a model's curve over one input, and the seeker that it guides.
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/guide/curve_seeking.hpp"
#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_settings.hpp"

namespace mgdd::bindings {
namespace {

using namespace guide;
constexpr double inf = std::numeric_limits<double>::infinity();

void bind_one_curve(py::module_& m) {
  py::class_<Curve>(m, "Curve",
                    R"(What a model says of one quantity over one input: a smooth curve through given points.

Between the points runs a cubic, beyond them a straight line.

Parameters
----------
inputs : array_like, shape (n,)
    Increasing inputs, three or more, in their unit.
values : array_like, shape (n,)
    What the model says there, in its unit.

Raises
------
mgdd.errors.ShapeError
    Fewer than three points, or not one value per input.
mgdd.errors.ParameterError
    A number that is not finite, or inputs that do not increase.

Examples
--------
>>> from mgdd.guide import Curve
>>> curve = Curve([-20.0, -10.0, 0.0, 10.0], [-5.0, 0.0, -4.0, -16.0])
>>> curve(-10.0), round(curve.best, 1)
(0.0, -9.4)
>>> round(Curve.parabola(curvature=-0.05, best=-6.0, reach=40.0)(-4.0), 3)
-0.1
)")
      .def(py::init([](const InputArray& inputs, const InputArray& values) {
             return Curve(to_column(inputs, "inputs"), to_column(values, "values"));
           }),
           py::arg("inputs"), py::arg("values"))
      .def_static("parabola", &Curve::parabola, py::kw_only(), py::arg("curvature"), py::arg("best"), py::arg("reach"),
                  "curvature/2 (x - best)^2 on [best - reach, best + reach]; ParameterError unless curvature < 0.")
      .def(
          "__call__",
          [](const Curve& c, const InputArray& x) {
            for (py::ssize_t i = 0; i < x.size(); ++i)
              if (!std::isfinite(x.data()[i])) throw ParameterError("inputs", x.data()[i], "must be finite");
            return elementwise(c, x);
          },
          py::arg("inputs"), "Value at one input or at many; ParameterError for one that is not finite.")
      .def_property_readonly("lower", &Curve::lower, "First input given.")
      .def_property_readonly("upper", &Curve::upper, "Last input given.")
      .def_property_readonly("best", &Curve::best, "Input of the largest value.")
      .def_property_readonly("top", &Curve::top, "The largest value.")
      .def("curvature", &Curve::curvature, py::arg("reach"), "Second difference over +-reach about the best input.")
      .def("__eq__",
           [](const Curve& c, const py::object& other) {
             return py::isinstance<Curve>(other) && c == other.cast<const Curve&>();
           })
      .def_property_readonly(
          "_table", [](const Curve& c) { return save_state(c); }, "What a file keeps of it.")
      .def_static(
          "_of_table",
          [](const StateColumns& table) {
            Curve out;
            restore_state(out, table);
            return out;
          },
          py::arg("table"), "The curve of such a table.")
      .def(py::pickle([](const Curve& c) { return py::make_tuple(1, save_state(c)); },
                      [](const py::tuple& state) {
                        require_pickle_version(state);
                        Curve out;
                        restore_state(out, state[1].cast<StateColumns>());
                        return out;
                      }));
}

void bind_curve_seeking(py::module_& m) {
  using B = BoundSeeker<CurveSeeking>;
  py::class_<B> cls(m, "CurveSeeking", "Seeking guided by a curve; see mgdd.guide.CurveSeeking.");
  bind_settings<CurveSeeking>(cls, "CurveSeeking");
  cls.def(
         "guide", [](B& b, const Curve& curve) { return b.use()->guide(curve); }, py::arg("curve"),
         "The operating point has changed, and the guide's curve with it.")
      .def_property_readonly(
          "estimate_sd", [](const B& b) { return b.use()->seeker().estimate_sd(); },
          "Standard deviation of the estimate as stated, in the unit of the input; NaN after a hand-over.")
      .def_property_readonly(
          "noise_sd", [](const B& b) { return b.use()->seeker().noise_sd(); },
          "Standard deviation of one reading of J, as learnt.")
      .def_property_readonly(
          "scale", [](const B& b) { return b.use()->seeker().scale(); },
          "Curvature of the plant's J over that of the guide, as learnt.")
      .def_property_readonly(
          "trust", [](const B& b) { return b.use()->seeker().trust(); },
          "Share of what the curve leaves that is noise, times the smaller of `scale` and its inverse; 0 after a "
          "hand-over.")
      .def_property_readonly(
          "doubts", [](const B& b) { return b.use()->seeker().doubts(); }, "How often the readings were doubted.")
      .def_property_readonly(
          "delay_cycles", [](const B& b) { return b.use()->seeker().delay_cycles(); },
          "Whole cycles between input and reading that explain the readings best.")
      .def_property_readonly(
          "answered", [](const B& b) { return b.use()->seeker().answered(); },
          "False where 60 readings and more have not shown that J answers the input: the estimate is the guide's.")
      .def_property_readonly(
          "handed_over", [](const B& b) { return b.use()->seeker().handed_over(); },
          "Whether plain extremum seeking is at work, because the guide kept failing.");
  bind_seeking(cls);
}

}  // namespace

void bind_curve(py::module_& m) {
  bind_one_curve(m);
  bind_curve_seeking(m);
}

}  // namespace mgdd::bindings
