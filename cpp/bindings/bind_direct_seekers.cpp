// Binds include/mgdd/optimize: SPSA, gradient descent, golden section, and the tuner.
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "mgdd/optimize/tuner.hpp"
#include "seeker_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace optimize;
constexpr double inf = std::numeric_limits<double>::infinity();

void bind_spsa(py::module_& m) {
  using B = BoundSeeker<Spsa>;
  const SpsaSettings d;
  py::class_<B> cls(m, "Spsa", "Simultaneous perturbation; see mgdd.optimize.Spsa.");
  cls.def(py::init([](const py::object& start, const py::object& lower, const py::object& upper,
                      const std::string& form, const std::string& schedule, std::optional<double> gain,
                      double stability, double gain_exponent, double perturbation, double perturbation_exponent,
                      std::optional<double> step_max, int averaging, bool blocking, double noise_sd,
                      double initial_hessian, double hessian_prior, double limit_amplitude, std::uint64_t seed,
                      bool maximize, const std::vector<Limit>& limits, std::optional<double> curvature) {
            SpsaSettings s;
            s.space = space_from(start, lower, upper);
            s.form = parse_spsa_form(form);
            s.schedule = parse_gain_schedule(schedule);
            s.gain = gain.value_or(0.0);
            if (gain && !(*gain > 0.0)) throw ParameterError("gain = " + std::to_string(*gain) + ": must be > 0");
            s.stability = stability;
            s.gain_exponent = gain_exponent;
            s.perturbation = perturbation;
            s.perturbation_exponent = perturbation_exponent;
            s.step_max = step_max.value_or(0.0);
            if (step_max && !(*step_max > 0.0)) {
              throw ParameterError("step_max = " + std::to_string(*step_max) + ": must be > 0");
            }
            s.averaging = averaging;
            s.blocking = blocking;
            s.noise_sd = noise_sd;
            s.initial_hessian = initial_hessian;
            s.hessian_prior = hessian_prior;
            s.limit_amplitude = limit_amplitude;
            s.seed = seed;
            s.maximize = maximize;
            s.limits = limits;
            s.curvature = none_as_nan(curvature);
            Spsa made(s);
            warn_each(made.settings().advice());
            return bound("Spsa", std::move(made));
          }),
          py::kw_only(), py::arg("start"), py::arg("lower") = -inf, py::arg("upper") = inf,
          py::arg("form") = "first_order", py::arg("schedule") = "decreasing", py::arg("gain") = py::none(),
          py::arg("stability") = d.stability, py::arg("gain_exponent") = d.gain_exponent,
          py::arg("perturbation") = d.perturbation, py::arg("perturbation_exponent") = d.perturbation_exponent,
          py::arg("step_max") = py::none(), py::arg("averaging") = d.averaging, py::arg("blocking") = d.blocking,
          py::arg("noise_sd") = d.noise_sd, py::arg("initial_hessian") = d.initial_hessian,
          py::arg("hessian_prior") = d.hessian_prior, py::arg("limit_amplitude") = d.limit_amplitude,
          py::arg("seed") = d.seed, py::arg("maximize") = true, py::arg("limits") = std::vector<Limit>{},
          py::arg("curvature") = py::none())
      .def_property_readonly(
          "hessian", [](const B& b) { return Eigen::MatrixXd(b.use()->seeker().hessian()); },
          "Averaged Hessian of the second-order form, shape (inputs, inputs).")
      .def_property_readonly(
          "iteration", [](const B& b) { return b.use()->seeker().iteration(); },
          "Iterations since the start or restart.")
      .def_property_readonly(
          "blocked", [](const B& b) { return b.use()->seeker().blocked(); }, "Steps that blocking refused.")
      .def_property_readonly(
          "measurements_per_iteration", [](const B& b) { return b.constant().seeker().measurements_per_iteration(); },
          "Cycles that one iteration takes.")
      .def_property_readonly(
          "settings",
          [](const B& b) {
            const SpsaSettings& s = b.constant().seeker().settings();
            py::dict out = space_dict(s.space);
            out["form"] = std::string(to_string(s.form));
            out["schedule"] = std::string(to_string(s.schedule));
            out["gain"] = s.gain;
            out["stability"] = s.stability;
            out["gain_exponent"] = s.gain_exponent;
            out["perturbation"] = s.perturbation;
            out["perturbation_exponent"] = s.perturbation_exponent;
            out["step_max"] = s.step_max;
            out["averaging"] = s.averaging;
            out["blocking"] = s.blocking;
            out["noise_sd"] = s.noise_sd;
            out["initial_hessian"] = s.initial_hessian;
            out["hessian_prior"] = s.hessian_prior;
            out["limit_amplitude"] = s.limit_amplitude;
            out["seed"] = s.seed;
            out["maximize"] = s.maximize;
            out["limits"] = s.limits;
            out["curvature"] = nan_as_none(s.curvature);
            return out;
          },
          "Arguments that make this seeker again.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_gradient_descent(py::module_& m) {
  using B = BoundSeeker<GradientDescent>;
  const GradientDescentSettings d;
  py::class_<B> cls(m, "GradientDescent", "Two-sided differences; see mgdd.optimize.GradientDescent.");
  cls.def(py::init([](const py::object& start, const py::object& lower, const py::object& upper, double step_size,
                      double difference, const py::object& rate, double tolerance, std::int64_t iterations,
                      bool maximize, const std::vector<Limit>& limits, std::optional<double> curvature) {
            GradientDescentSettings s;
            s.space = space_from(start, lower, upper);
            s.step_size = step_size;
            s.difference = difference;
            if (!rate.is_none()) s.rate = inputs_from(rate, "rate", s.space.size());
            s.tolerance = tolerance;
            s.iterations = iterations;
            s.maximize = maximize;
            s.limits = limits;
            s.curvature = none_as_nan(curvature);
            GradientDescent made(s);
            warn_each(s.advice());
            return bound("GradientDescent", std::move(made));
          }),
          py::kw_only(), py::arg("start"), py::arg("lower") = -inf, py::arg("upper") = inf,
          py::arg("step_size") = d.step_size, py::arg("difference") = d.difference, py::arg("rate") = py::none(),
          py::arg("tolerance") = d.tolerance, py::arg("iterations") = d.iterations, py::arg("maximize") = true,
          py::arg("limits") = std::vector<Limit>{}, py::arg("curvature") = py::none())
      .def_property_readonly(
          "iteration", [](const B& b) { return b.use()->seeker().iteration(); }, "Steps made.")
      .def_property_readonly(
          "converged_at",
          [](const B& b) {
            const std::int64_t at = b.use()->seeker().converged_at();
            return at < 0 ? py::object(py::none()) : py::object(py::int_(at));
          },
          "Step at which the tolerance was met first, or None.")
      .def_property_readonly(
          "settings",
          [](const B& b) {
            const GradientDescentSettings& s = b.constant().seeker().settings();
            py::dict out = space_dict(s.space);
            out["step_size"] = s.step_size;
            out["difference"] = s.difference;
            out["rate"] = list_of(s.rate);
            out["tolerance"] = s.tolerance;
            out["iterations"] = s.iterations;
            out["maximize"] = s.maximize;
            out["limits"] = s.limits;
            out["curvature"] = nan_as_none(s.curvature);
            return out;
          },
          "Arguments that make this seeker again.");
  bind_seeking(cls);
  bind_gradient(cls);
}

void bind_golden_section(py::module_& m) {
  using B = BoundSeeker<GoldenSection>;
  const GoldenSectionSettings d;
  py::class_<B> cls(m, "GoldenSection", "Golden-section search; see mgdd.optimize.GoldenSection.");
  cls.def(py::init([](const py::object& start, const py::object& lower, const py::object& upper, double noise_sd,
                      double significance, int samples_max, double tolerance, bool maximize,
                      const std::vector<Limit>& limits) {
            GoldenSectionSettings s;
            s.space = space_from(start, lower, upper);
            s.noise_sd = noise_sd;
            s.significance = significance;
            s.samples_max = samples_max;
            s.tolerance = tolerance;
            s.maximize = maximize;
            s.limits = limits;
            return bound("GoldenSection", GoldenSection(s));
          }),
          py::kw_only(), py::arg("start"), py::arg("lower"), py::arg("upper"), py::arg("noise_sd") = d.noise_sd,
          py::arg("significance") = d.significance, py::arg("samples_max") = d.samples_max,
          py::arg("tolerance") = d.tolerance, py::arg("maximize") = true, py::arg("limits") = std::vector<Limit>{})
      .def_property_readonly(
          "bracket",
          [](const B& b) {
            const auto r = b.use();
            return std::pair(r->seeker().lower(), r->seeker().upper());
          },
          "Present bracket, lower and upper end.")
      .def_property_readonly(
          "converged", [](const B& b) { return b.use()->seeker().converged(); },
          "Whether the bracket is as small as tolerance or noise allow.")
      .def_property_readonly(
          "settings",
          [](const B& b) {
            const GoldenSectionSettings& s = b.constant().seeker().settings();
            py::dict out = space_dict(s.space);
            out["noise_sd"] = s.noise_sd;
            out["significance"] = s.significance;
            out["samples_max"] = s.samples_max;
            out["tolerance"] = s.tolerance;
            out["maximize"] = s.maximize;
            out["limits"] = s.limits;
            return out;
          },
          "Arguments that make this seeker again.");
  bind_seeking(cls);
}

void bind_tuner(py::module_& m) {
  m.def(
      "tune",
      [](double noise_sd, double curvature, const std::string& method, double delay_cycles, double lag_cycles,
         bool compensated, std::optional<double> rms, std::optional<double> cycles, std::optional<double> distance,
         std::optional<double> arrival, std::optional<double> amplitude_max) {
        TuningWish w;
        w.method = parse_tuned_method(method);
        w.noise_sd = noise_sd;
        w.curvature = curvature;
        w.lag = {delay_cycles, lag_cycles};
        w.compensated = compensated;
        w.rms = none_as_nan(rms);
        w.cycles = none_as_nan(cycles);
        w.distance = none_as_nan(distance);
        w.arrival = none_as_nan(arrival);
        w.amplitude_max = none_as_nan(amplitude_max);
        const Tuning t = tune(w);
        py::dict out;
        out["method"] = std::string(to_string(t.method));
        out["amplitude"] = t.amplitude;
        out["period"] = t.period;
        out["gain"] = t.gain;
        out["rate"] = t.rate;
        out["time_constant_cycles"] = t.time_constant_cycles;
        out["rms"] = t.rms;
        out["cycles"] = t.cycles;
        out["dither_cost"] = t.dither_cost;
        out["jitter_cost"] = t.jitter_cost;
        out["sensor_gain"] = t.sensor_gain;
        out["sensor_phase_deg"] = t.sensor_phase_rad * 180.0 / 3.14159265358979323846;
        out["met"] = t.met;
        out["reasons"] = t.reasons;
        return out;
      },
      py::kw_only(), py::arg("noise_sd"), py::arg("curvature"), py::arg("method"), py::arg("delay_cycles"),
      py::arg("lag_cycles"), py::arg("compensated"), py::arg("rms"), py::arg("cycles"), py::arg("distance"),
      py::arg("arrival"), py::arg("amplitude_max"), "Behind mgdd.optimize.tune.");
}

}  // namespace

void bind_direct_seekers(py::module_& m) {
  bind_spsa(m);
  bind_gradient_descent(m);
  bind_golden_section(m);
  bind_tuner(m);
}

}  // namespace mgdd::bindings
