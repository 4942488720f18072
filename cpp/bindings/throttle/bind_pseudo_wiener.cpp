// Binds include/mgdd/throttle/models/pseudo_wiener.hpp: the three models behind mgdd.throttle.PseudoWiener.
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/dynamics/predict.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/pseudo_wiener_numbers.hpp"
#include "throttle/pseudo_wiener_binding.hpp"

namespace mgdd::bindings {

using namespace mgdd::throttle;

py::dict parameters_of(const PseudoWiener& model) {
  py::dict out;
  for (const NamedNumber& number : named_numbers(model))
    out[as_str(number.name)] = number.value;
  return out;
}

namespace {

std::vector<double> run_free(const BoundModel& self, const std::vector<double>& duty, double start_deg) {
  std::vector<double> angle(duty.size());
  std::visit(
      [&](const auto& model) {
        auto state = model.at_rest(start_deg, 0.0);
        dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(angle));
      },
      prepare(self.parameters));
  return angle;
}

std::vector<double> run_ahead(const BoundModel& self, const std::vector<double>& duty, const std::vector<double>& angle,
                              std::size_t horizon, const ObserverGains& gains) {
  gains.validate();
  if (duty.size() != angle.size()) {
    throw about("duty", ShapeError("duty has " + std::to_string(duty.size()) + " samples: angle_deg has " +
                                   std::to_string(angle.size())));
  }
  if (horizon < 1 || horizon >= duty.size()) {
    throw ParameterError("horizon", horizon,
                         "must be in [1, " + std::to_string(duty.size() - 1) + "], below the samples of the log");
  }
  std::vector<double> out(duty.size() - horizon);
  std::visit(
      [&](const auto& model) {
        dynamics::predict_ahead(model, model.at_rest(angle.front(), 0.0), gains, horizon, duty, angle, out);
      },
      prepare(self.parameters));
  return out;
}

// Angle over a horizon from rest at `start_deg` after `before`, and d angle / d duty.
std::pair<std::vector<double>, Eigen::MatrixXd> run_slopes(const BoundModel& self, const std::vector<double>& duty,
                                                           double start_deg, double speed_deg_per_s) {
  const auto n = static_cast<Eigen::Index>(duty.size());
  std::vector<double> angle(duty.size());
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(n, n);
  std::visit(
      [&](const auto& model) {
        auto state = model.at_rest(start_deg, duty.front());
        if constexpr (requires { state.speed_deg_per_s; }) state.speed_deg_per_s = speed_deg_per_s;
        dynamics::predict_every_sample(model, state, duty, angle, [&](std::size_t k, std::size_t i, double derivative) {
          slope(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)) = derivative;
        });
      },
      prepare(self.parameters));
  return {angle, slope};
}

}  // namespace

void bind_pseudo_wiener(py::module_& m) {
  using py::arg;
  py::class_<BoundModel>(m, "PseudoWienerModel", "A pseudo-Wiener model; use mgdd.throttle.PseudoWiener.")
      .def(py::init([](const std::string& kind, const std::map<std::string, double>& parameters,
                       const std::string& switching, const std::string& friction) {
             return BoundModel{pseudo_wiener_from(kind, parameters, switching, friction)};
           }),
           arg("kind"), arg("parameters"), py::kw_only(), arg("switching") = "predicted",
           arg("friction") = "set_valued")
      .def_property_readonly("kind", [](const BoundModel& s) { return as_str(name_of(kind_of(s.parameters))); })
      .def_property_readonly("parameters", [](const BoundModel& s) { return parameters_of(s.parameters); })
      .def("__eq__",
           [](const BoundModel& s, const py::object& other) {
             return py::isinstance<BoundModel>(other) && s == other.cast<const BoundModel&>();
           })
      .def(
          "at_sample",
          [](const BoundModel& s, double sample_s, std::optional<int> substeps) {
            BoundModel other = s;
            std::visit(
                [&](auto& p) {
                  p.frame = p.frame.at_sample(sample_s);
                  if (substeps) p.frame.substeps = *substeps;
                },
                other.parameters);
            validate(other.parameters);
            return parameters_of(other.parameters);
          },
          arg("sample_s"), py::kw_only(), arg("substeps") = std::nullopt,
          "Parameters for another sample time, the delay in seconds kept.")
      .def(
          "simulate",
          [](const BoundModel& s, const InputArray& duty, double start_deg) {
            const auto column = to_column(duty, "duty");
            return to_array(without_gil([&] { return run_free(s, column, start_deg); }));
          },
          arg("duty"), arg("start_deg"), "Free run: angle [deg] per sample.")
      .def(
          "predict",
          [](const BoundModel& s, const InputArray& duty, const InputArray& angle, std::size_t horizon,
             double angle_gain, double speed_gain_per_s, double bias_gain_duty_per_deg, double offset_gain) {
            ObserverGains a;
            a.angle_gain = angle_gain;
            a.speed_gain_per_s = speed_gain_per_s;
            a.bias_gain_duty_per_deg = bias_gain_duty_per_deg;
            a.offset_gain = offset_gain;
            const auto u = to_column(duty, "duty");
            const auto y = to_column(angle, "angle_deg");
            const py::gil_scoped_release release;
            return run_ahead(s, u, y, horizon, a);
          },
          arg("duty"), arg("angle_deg"), arg("horizon"), py::kw_only(), arg("angle_gain") = ObserverGains{}.angle_gain,
          arg("speed_gain_per_s") = ObserverGains{}.speed_gain_per_s,
          arg("bias_gain_duty_per_deg") = ObserverGains{}.bias_gain_duty_per_deg,
          arg("offset_gain") = ObserverGains{}.offset_gain,
          "Prediction, corrected at every sample, `horizon` samples ahead [deg].")
      .def(
          "slopes",
          [](const BoundModel& s, const InputArray& duty, double start_deg, double speed_deg_per_s) {
            const auto column = to_column(duty, "duty");
            if (column.empty()) throw about("duty", ShapeError("duty is empty: a horizon needs at least one sample"));
            const auto [angle, slope] = without_gil([&] { return run_slopes(s, column, start_deg, speed_deg_per_s); });
            return py::make_tuple(to_array(angle), slope);
          },
          arg("duty"), py::kw_only(), arg("start_deg"), arg("speed_deg_per_s") = 0.0,
          "Angle after each sample of a horizon [deg] and d angle / d duty [deg].");
  m.def(
      "pseudo_wiener_of",
      [](const Throttle& t) {
        validate(t);
        return BoundModel{pw_r_of(t)};
      },
      arg("throttle"), "PW-R with the groups of a first-principle throttle.");
  m.def(
      "pseudo_wiener_units",
      [](const std::string& kind) {
        py::dict out;
        for (const NamedNumber& number : named_numbers(parse_name<PseudoWienerKind>("kind", kind)))
          out[as_str(number.name)] = as_str(number.unit);
        return out;
      },
      arg("kind"), "Unit of every parameter.");
}

}  // namespace mgdd::bindings
