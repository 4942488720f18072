// Binds include/mgdd/optimize: the dithering seekers (extremum seeking, Newton, bounded).
#include <tuple>

#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_settings.hpp"

namespace mgdd::bindings {
namespace {

using namespace optimize;

void bind_extremum_seeking(py::module_& m) {
  using B = BoundSeeker<ExtremumSeeking>;
  using S = ExtremumSeekingSettings;
  py::class_<B> cls(m, "ExtremumSeeking", "Extremum seeking; see mgdd.optimize.ExtremumSeeking.");
  const auto rows = std::tuple_cat(
      std::tuple{choice("form", &S::form, &parse_mean_removal)}, dither_rows<S>(),
      std::tuple{per_input_or_none("gain", &S::gain), per_input_or_none("rate", &S::rate),
                 per_input_or_none("recovery_rate", &S::recovery_rate), plain("washout_pole", &S::washout_pole),
                 plain("low_pass", &S::low_pass), or_default("components", &S::components),
                 plain("hold_cycles", &S::hold_cycles), plain("amplitude_floor", &S::amplitude_floor),
                 plain("full_gradient", &S::full_gradient), plain("limit_amplitude", &S::limit_amplitude),
                 plain("maximize", &S::maximize), plain("limits", &S::limits), plain("curvature", &S::curvature)});
  const S standard;
  bind_settings<ExtremumSeeking>(cls, "ExtremumSeeking", standard, rows, py::arg("lower") = -inf,
                                 py::arg("upper") = inf);
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
  using S = NewtonSeekingSettings;
  py::class_<B> cls(m, "NewtonSeeking", "Newton extremum seeking; see mgdd.optimize.NewtonSeeking.");
  const auto rows = std::tuple_cat(
      dither_rows<S>(),
      std::tuple{plain("time_constant_cycles", &S::time_constant_cycles), plain("hessian_rate", &S::hessian_rate),
                 plain("riccati_rate", &S::riccati_rate), per_input_or_none("initial_hessian", &S::initial_hessian),
                 per_input_or_none("initial_inverse", &S::initial_inverse),
                 positive_or_own("largest_inverse", &S::largest_inverse), plain("hold_cycles", &S::hold_cycles),
                 per_input_or_none("rate", &S::rate), or_default("components", &S::components),
                 plain("limit_amplitude", &S::limit_amplitude), plain("maximize", &S::maximize),
                 plain("limits", &S::limits)});
  const S standard;
  bind_settings<NewtonSeeking>(cls, "NewtonSeeking", standard, rows, py::arg("lower") = -inf, py::arg("upper") = inf);
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
  using S = BoundedSeekingSettings;
  py::class_<B> cls(m, "BoundedSeeking", "Bounded extremum seeking; see mgdd.optimize.BoundedSeeking.");
  const auto rows =
      std::tuple_cat(dither_rows<S>(), std::tuple{positive_or_own("kappa", &S::kappa), plain("maximize", &S::maximize),
                                                  plain("limits", &S::limits), plain("curvature", &S::curvature)});
  const S standard;
  bind_settings<BoundedSeeking>(cls, "BoundedSeeking", standard, rows, py::arg("lower") = -inf, py::arg("upper") = inf);
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
