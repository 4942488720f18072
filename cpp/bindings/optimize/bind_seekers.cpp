// Binds include/mgdd/optimize: the dithering seekers (extremum seeking, Newton, bounded).

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

void bind_newton(py::module_& m) {
  using B = BoundSeeker<NewtonSeeking>;
  py::class_<B> cls(m, "NewtonSeeking", "Newton extremum seeking; see mgdd.optimize.NewtonSeeking.");
  bind_settings<NewtonSeeking>(cls, "NewtonSeeking");
  cls.def_property_readonly(
         "hessian", [](const B& b) { return Eigen::MatrixXd(b.use()->seeker().hessian()); },
         "Filtered Hessian of the maximised objective, shape (inputs, inputs).")
      .def_property_readonly(
          "inverse_hessian", [](const B& b) { return Eigen::MatrixXd(b.use()->seeker().inverse_hessian()); },
          "State of the Riccati filter, which tends to the inverse Hessian.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_bounded(py::module_& m) {
  using B = BoundSeeker<BoundedSeeking>;
  py::class_<B> cls(m, "BoundedSeeking", "Bounded extremum seeking; see mgdd.optimize.BoundedSeeking.");
  bind_settings<BoundedSeeking>(cls, "BoundedSeeking");
  cls.def_property_readonly(
      "kappa", [](const B& b) { return b.use()->seeker().kappa(); },
      "Phase per unit of J in use; None while the first readings are taken.");
  bind_seeking(cls);
}

}  // namespace

void bind_seekers(py::module_& m) {
  bind_extremum_seeking(m);
  bind_newton(m);
  bind_bounded(m);
}

}  // namespace mgdd::bindings
