// Binds include/mgdd/optimize: the dithering seekers (extremum seeking, Newton, bounded).
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "seeker_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace optimize;
constexpr double inf = std::numeric_limits<double>::infinity();

DitherSettings dither_from(const py::object& amplitude, int period, const std::optional<std::vector<int>>& harmonics,
                           Eigen::Index inputs) {
  DitherSettings d;
  d.amplitude = inputs_from(amplitude, "amplitude", inputs);
  d.period = period;
  if (harmonics) d.harmonics = *harmonics;
  return d;
}

Inputs optional_inputs(const py::object& value, std::string_view name, Eigen::Index inputs) {
  return value.is_none() ? Inputs{} : inputs_from(value, name, inputs);
}

void add_dither(py::dict& out, const DitherSettings& d) {
  out["amplitude"] = list_of(d.amplitude);
  out["period"] = d.period;
  out["harmonics"] = d.harmonics;
}

std::vector<ComponentLag> components_from(const std::optional<std::vector<ComponentLag>>& components) {
  return components.value_or(std::vector<ComponentLag>{ComponentLag{}});
}

void bind_extremum_seeking(py::module_& m) {
  using B = BoundSeeker<ExtremumSeeking>;
  const ExtremumSeekingSettings d;
  py::class_<B> cls(m, "ExtremumSeeking", "Extremum seeking; see mgdd.optimize.ExtremumSeeking.");
  cls.def(py::init([](const py::object& start, const py::object& lower, const py::object& upper,
                      const std::string& form, const py::object& amplitude, int period,
                      const std::optional<std::vector<int>>& harmonics, const py::object& gain, const py::object& rate,
                      const py::object& recovery_rate, double washout_pole, double low_pass,
                      const std::optional<std::vector<ComponentLag>>& components, std::optional<int> hold_cycles,
                      double amplitude_floor, double full_gradient, double limit_amplitude, bool maximize,
                      const std::vector<Limit>& limits, std::optional<double> curvature) {
            ExtremumSeekingSettings s;
            s.space = space_from(start, lower, upper);
            s.form = parse_mean_removal(form);
            s.dither = dither_from(amplitude, period, harmonics, s.space.size());
            s.gain = inputs_from(gain, "gain", s.space.size());
            s.rate = optional_inputs(rate, "rate", s.space.size());
            s.recovery_rate = optional_inputs(recovery_rate, "recovery_rate", s.space.size());
            s.washout_pole = washout_pole;
            s.low_pass = low_pass;
            s.components = components_from(components);
            s.hold_cycles = hold_cycles.value_or(-1);
            s.amplitude_floor = amplitude_floor;
            s.full_gradient = full_gradient;
            s.limit_amplitude = limit_amplitude;
            s.maximize = maximize;
            s.limits = limits;
            s.curvature = none_as_nan(curvature);
            ExtremumSeeking made(s);
            warn_each(s.advice());
            return bound("ExtremumSeeking", std::move(made));
          }),
          py::kw_only(), py::arg("start"), py::arg("lower") = -inf, py::arg("upper") = inf, py::arg("form") = "batch",
          py::arg("amplitude") = 1.0, py::arg("period") = d.dither.period, py::arg("harmonics") = py::none(),
          py::arg("gain") = d.gain[0], py::arg("rate") = py::none(), py::arg("recovery_rate") = py::none(),
          py::arg("washout_pole") = d.washout_pole, py::arg("low_pass") = d.low_pass,
          py::arg("components") = py::none(), py::arg("hold_cycles") = py::none(),
          py::arg("amplitude_floor") = d.amplitude_floor, py::arg("full_gradient") = d.full_gradient,
          py::arg("limit_amplitude") = d.limit_amplitude, py::arg("maximize") = true,
          py::arg("limits") = std::vector<Limit>{}, py::arg("curvature") = py::none())
      .def_property_readonly(
          "amplitude_share", [](const B& b) { return b.use()->seeker().amplitude_share(); },
          "Amplitude now over that of the settings.")
      .def_property_readonly(
          "settings",
          [](const B& b) {
            const ExtremumSeekingSettings& s = b.constant().seeker().settings();
            py::dict out = space_dict(s.space);
            out["form"] = std::string(to_string(s.form));
            add_dither(out, s.dither);
            out["gain"] = list_of(s.gain);
            out["rate"] = list_of(s.rate);
            out["recovery_rate"] = list_of(s.recovery_rate);
            out["washout_pole"] = s.washout_pole;
            out["low_pass"] = s.low_pass;
            out["components"] = s.components;
            out["hold_cycles"] = s.hold_cycles;
            out["amplitude_floor"] = s.amplitude_floor;
            out["full_gradient"] = s.full_gradient;
            out["limit_amplitude"] = s.limit_amplitude;
            out["maximize"] = s.maximize;
            out["limits"] = s.limits;
            out["curvature"] = nan_as_none(s.curvature);
            return out;
          },
          "Arguments that make this seeker again.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_newton(py::module_& m) {
  using B = BoundSeeker<NewtonSeeking>;
  const NewtonSeekingSettings d;
  py::class_<B> cls(m, "NewtonSeeking", "Newton extremum seeking; see mgdd.optimize.NewtonSeeking.");
  cls.def(py::init([](const py::object& start, const py::object& lower, const py::object& upper,
                      const py::object& amplitude, int period, const std::optional<std::vector<int>>& harmonics,
                      double time_constant_cycles, double hessian_rate, double riccati_rate,
                      const py::object& initial_hessian, const py::object& initial_inverse, double largest_inverse,
                      int hold_cycles, const py::object& rate,
                      const std::optional<std::vector<ComponentLag>>& components, double limit_amplitude, bool maximize,
                      const std::vector<Limit>& limits) {
            NewtonSeekingSettings s;
            s.space = space_from(start, lower, upper);
            const Eigen::Index n = s.space.size();
            s.dither = dither_from(amplitude, period, harmonics, n);
            s.time_constant_cycles = time_constant_cycles;
            s.hessian_rate = hessian_rate;
            s.riccati_rate = riccati_rate;
            s.initial_hessian = inputs_from(initial_hessian, "initial_hessian", n);
            s.initial_inverse = inputs_from(initial_inverse, "initial_inverse", n);
            s.largest_inverse = largest_inverse;
            s.hold_cycles = hold_cycles;
            s.rate = optional_inputs(rate, "rate", n);
            s.components = components_from(components);
            s.limit_amplitude = limit_amplitude;
            s.maximize = maximize;
            s.limits = limits;
            NewtonSeeking made(s);
            warn_each(s.advice());
            return bound("NewtonSeeking", std::move(made));
          }),
          py::kw_only(), py::arg("start"), py::arg("lower") = -inf, py::arg("upper") = inf,
          py::arg("amplitude") = d.dither.amplitude[0], py::arg("period") = d.dither.period,
          py::arg("harmonics") = py::none(), py::arg("time_constant_cycles") = d.time_constant_cycles,
          py::arg("hessian_rate") = d.hessian_rate, py::arg("riccati_rate") = d.riccati_rate,
          py::arg("initial_hessian") = d.initial_hessian[0], py::arg("initial_inverse") = d.initial_inverse[0],
          py::arg("largest_inverse") = d.largest_inverse, py::arg("hold_cycles") = d.hold_cycles,
          py::arg("rate") = py::none(), py::arg("components") = py::none(),
          py::arg("limit_amplitude") = d.limit_amplitude, py::arg("maximize") = true,
          py::arg("limits") = std::vector<Limit>{})
      .def_property_readonly(
          "hessian", [](const B& b) { return Eigen::MatrixXd(b.use()->seeker().hessian()); },
          "Filtered Hessian of the maximised objective, shape (inputs, inputs).")
      .def_property_readonly(
          "inverse_hessian", [](const B& b) { return Eigen::MatrixXd(b.use()->seeker().inverse_hessian()); },
          "State of the Riccati filter, which tends to the inverse Hessian.")
      .def_property_readonly(
          "settings",
          [](const B& b) {
            const NewtonSeekingSettings& s = b.constant().seeker().settings();
            py::dict out = space_dict(s.space);
            add_dither(out, s.dither);
            out["time_constant_cycles"] = s.time_constant_cycles;
            out["hessian_rate"] = s.hessian_rate;
            out["riccati_rate"] = s.riccati_rate;
            out["initial_hessian"] = list_of(s.initial_hessian);
            out["initial_inverse"] = list_of(s.initial_inverse);
            out["largest_inverse"] = s.largest_inverse;
            out["hold_cycles"] = s.hold_cycles;
            out["rate"] = list_of(s.rate);
            out["components"] = s.components;
            out["limit_amplitude"] = s.limit_amplitude;
            out["maximize"] = s.maximize;
            out["limits"] = s.limits;
            return out;
          },
          "Arguments that make this seeker again.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_bounded(py::module_& m) {
  using B = BoundSeeker<BoundedSeeking>;
  py::class_<B> cls(m, "BoundedSeeking", "Bounded extremum seeking; see mgdd.optimize.BoundedSeeking.");
  cls.def(py::init([](const py::object& start, const py::object& lower, const py::object& upper,
                      const py::object& amplitude, int period, const std::optional<std::vector<int>>& harmonics,
                      double kappa, bool maximize, const std::vector<Limit>& limits, std::optional<double> curvature) {
            BoundedSeekingSettings s;
            s.space = space_from(start, lower, upper);
            s.dither = dither_from(amplitude, period, harmonics, s.space.size());
            s.kappa = kappa;
            s.maximize = maximize;
            s.limits = limits;
            s.curvature = none_as_nan(curvature);
            BoundedSeeking made(s);
            warn_each(s.advice());
            return bound("BoundedSeeking", std::move(made));
          }),
          py::kw_only(), py::arg("start"), py::arg("lower") = -inf, py::arg("upper") = inf, py::arg("amplitude") = 1.0,
          py::arg("period") = 10, py::arg("harmonics") = py::none(), py::arg("kappa") = 1.0, py::arg("maximize") = true,
          py::arg("limits") = std::vector<Limit>{}, py::arg("curvature") = py::none())
      .def_property_readonly(
          "settings",
          [](const B& b) {
            const BoundedSeekingSettings& s = b.constant().seeker().settings();
            py::dict out = space_dict(s.space);
            add_dither(out, s.dither);
            out["kappa"] = s.kappa;
            out["maximize"] = s.maximize;
            out["limits"] = s.limits;
            out["curvature"] = nan_as_none(s.curvature);
            return out;
          },
          "Arguments that make this seeker again.");
  bind_seeking(cls);
}

}  // namespace

void bind_seekers(py::module_& m) {
  bind_extremum_seeking(m);
  bind_newton(m);
  bind_bounded(m);
}

}  // namespace mgdd::bindings
