// Binds include/mgdd/throttle/models/pseudo_wiener.hpp: the three models behind mgdd.throttle.PseudoWiener.
#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "pseudo_wiener_binding.hpp"

namespace mgdd::bindings {

using namespace mgdd::throttle;

namespace {

struct Setting {
  const char* name;
  const char* unit;
};
// Settings that stand beside the numbers of a kind, all as plain numbers so that a file can hold them.
std::vector<Setting> settings_of(PseudoWienerKind kind) {
  std::vector<Setting> out{{"closed_deg", "deg"}, {"open_deg", "deg"}, {"sample_s", "s"}, {"delay_samples", "samples"}};
  if (kind == PseudoWienerKind::pw_r) {
    out.insert(out.end(),
               {{"substeps", "-"}, {"ramp_deg", "deg"}, {"tanh_deg_per_s", "deg/s"}, {"dead_band_deg", "deg"}});
  } else {
    out.push_back({"map_start", "-"});
    if (kind == PseudoWienerKind::pw_p) out.push_back({"plays", "-"});
    if (kind == PseudoWienerKind::pw_w) out.insert(out.end(), {{"knot_lower_duty", "-"}, {"knot_upper_duty", "-"}});
  }
  return out;
}

template <class P>
double get_setting(const P& p, std::string_view name) {
  if (name == "closed_deg") return p.frame.closed_deg;
  if (name == "open_deg") return p.frame.open_deg;
  if (name == "sample_s") return p.frame.sample_s;
  if (name == "delay_samples") return p.frame.delay_samples;
  if (name == "substeps") return p.frame.substeps;
  if constexpr (requires { p.ramp_deg; }) {
    if (name == "ramp_deg") return p.ramp_deg;
    if (name == "tanh_deg_per_s") return p.tanh_deg_per_s;
    if (name == "dead_band_deg") return p.dead_band_deg;
  } else {
    if (name == "map_start") return p.lag_start == LagStart::inverse_map ? 1.0 : 0.0;
  }
  if constexpr (requires { p.plays; }) {
    if (name == "plays") return p.plays;
  }
  if constexpr (requires { p.knot_lower_duty; }) {
    if (name == "knot_lower_duty") return p.knot_lower_duty;
    if (name == "knot_upper_duty") return p.knot_upper_duty;
  }
  throw ParameterError("setting '" + std::string(name) + "' is unknown");
}

int whole(std::string_view name, double value) {
  if (!(value >= 0.0 && value <= 1e6) || value != static_cast<double>(static_cast<int>(value))) {
    throw ParameterError(std::string(name) + " = " + text(value) + ": must be a whole number");
  }
  return static_cast<int>(value);
}

template <class P>
void put_setting(P& p, std::string_view name, double value) {
  if (name == "closed_deg") p.frame.closed_deg = value;
  if (name == "open_deg") p.frame.open_deg = value;
  if (name == "sample_s") p.frame.sample_s = value;
  if (name == "delay_samples") p.frame.delay_samples = value;
  if (name == "substeps") p.frame.substeps = whole(name, value);
  if constexpr (requires { p.ramp_deg; }) {
    if (name == "ramp_deg") p.ramp_deg = value;
    if (name == "tanh_deg_per_s") p.tanh_deg_per_s = value;
    if (name == "dead_band_deg") p.dead_band_deg = value;
  } else {
    if (name == "map_start") {
      if (value != 0.0 && value != 1.0) throw ParameterError("map_start = " + text(value) + ": must be 0 or 1");
      p.lag_start = value == 1.0 ? LagStart::inverse_map : LagStart::rest;
    }
  }
  if constexpr (requires { p.plays; }) {
    if (name == "plays") p.plays = whole(name, value);
  }
  if constexpr (requires { p.knot_lower_duty; }) {
    if (name == "knot_lower_duty") p.knot_lower_duty = value;
    if (name == "knot_upper_duty") p.knot_upper_duty = value;
  }
}

// Numbers beyond the plays that a model has are not shown.
std::size_t shown(const PseudoWiener& p, std::size_t index) {
  if (const auto* play = std::get_if<PwP>(&p)) {
    const auto last = 3 + 2 * static_cast<std::size_t>(play->plays);
    return index < last || index == n_pw_p - 1 ? 1 : 0;
  }
  return 1;
}

}  // namespace

PseudoWiener make_pseudo_wiener(const std::string& kind, const std::map<std::string, double>& given,
                                const std::string& switching, const std::string& friction) {
  PseudoWiener out;
  const PseudoWienerKind k = parse_name(pseudo_wiener_names(), "kind", kind);
  if (k == PseudoWienerKind::pw_w) out = PwW{};
  if (k == PseudoWienerKind::pw_p) out = PwP{};
  const auto rows = fields(k);
  const auto settings = settings_of(k);
  std::visit(
      [&](auto& p) {
        const auto places = numbers(p);
        for (const auto& [name, value] : given) {
          const auto row = std::ranges::find(rows, name, &FieldInfo::name);
          if (row != rows.end()) {
            *places[static_cast<std::size_t>(row - rows.begin())] = value;
          } else if (std::ranges::any_of(settings, [&](const Setting& s) { return name == s.name; })) {
            put_setting(p, name, value);
          } else {
            throw ParameterError("parameters: '" + name + "' is no parameter of " + kind);
          }
        }
        if constexpr (requires { p.switching; }) {
          p.switching = parse_name(switching_names(), "switching", switching);
          p.friction = parse_name(dry_friction_names(), "friction", friction);
        }
      },
      out);
  validate(out);
  return out;
}

py::dict parameters_of(const PseudoWiener& model) {
  const PseudoWienerKind k = kind_of(model);
  const auto rows = fields(k);
  py::dict out;
  std::visit(
      [&](const auto& p) {
        const auto places = numbers(p);
        for (std::size_t i = 0; i < rows.size(); ++i)
          if (shown(model, i) != 0) out[as_str(rows[i].name)] = *places[i];
        for (const Setting& s : settings_of(k))
          out[s.name] = get_setting(p, s.name);
      },
      model);
  return out;
}

namespace {

struct BoundModel {
  PseudoWiener parameters;
  bool operator==(const BoundModel&) const = default;
};

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
    throw ShapeError("duty has " + std::to_string(duty.size()) + " samples: angle_deg has " +
                     std::to_string(angle.size()));
  }
  if (horizon < 1 || horizon >= duty.size()) {
    throw ParameterError("horizon = " + std::to_string(horizon) + ": must be in [1, " +
                         std::to_string(duty.size() - 1) + "], below the samples of the log");
  }
  std::vector<double> out(duty.size() - horizon);
  std::visit(
      [&](const auto& model) {
        auto state = model.at_rest(angle.front(), 0.0);
        for (std::size_t k = 0; k < out.size(); ++k) {
          model.correct(state, angle[k], gains);
          auto ahead = state;
          for (std::size_t j = 0; j < horizon; ++j)
            model.step(ahead, duty[k + j]);
          out[k] = model.output(ahead);
          model.step(state, duty[k]);
        }
      },
      prepare(self.parameters));
  return out;
}

// Angle over a horizon from rest at `start_deg` after `before`, and d angle / d duty.
std::pair<std::vector<double>, Eigen::MatrixXd> run_slopes(const BoundModel& self, const std::vector<double>& duty,
                                                           double start_deg, double speed_deg_per_s) {
  constexpr int lanes = 4;
  using D = Dual<lanes>;
  const auto n = duty.size();
  std::vector<double> angle(n);
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  std::visit(
      [&](const auto& p) {
        const auto model = model_of(lift<D>(p));
        for (std::size_t first = 0; first < n; first += lanes) {
          auto state = model.at_rest(D(start_deg), D(duty.front()));
          if constexpr (requires { state.speed_deg_per_s; }) state.speed_deg_per_s = D(speed_deg_per_s);
          for (std::size_t k = 0; k < n; ++k) {
            D u(duty[k]);
            if (k >= first && k - first < lanes) u.grad[k - first] = 1.0;
            model.step(state, u);
            const D y = model.output(state);
            angle[k] = y.value;
            for (std::size_t i = 0; i < lanes && first + i < n; ++i)
              slope(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(first + i)) = y.grad[i];
          }
        }
      },
      self.parameters);
  return {angle, slope};
}

}  // namespace

void bind_pseudo_wiener(py::module_& m) {
  using py::arg;
  py::class_<BoundModel>(m, "PseudoWienerModel", "A pseudo-Wiener model; use mgdd.throttle.PseudoWiener.")
      .def(py::init([](const std::string& kind, const std::map<std::string, double>& parameters,
                       const std::string& switching, const std::string& friction) {
             return BoundModel{make_pseudo_wiener(kind, parameters, switching, friction)};
           }),
           arg("kind"), arg("parameters"), py::kw_only(), arg("switching") = "predicted",
           arg("friction") = "set_valued")
      .def_property_readonly(
          "kind", [](const BoundModel& s) { return as_str(name_of(pseudo_wiener_names(), kind_of(s.parameters))); })
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
            if (column.empty()) throw ShapeError("duty is empty: a horizon needs at least one sample");
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
        const PseudoWienerKind k = parse_name(pseudo_wiener_names(), "kind", kind);
        py::dict out;
        for (const auto& row : fields(k))
          out[as_str(row.name)] = as_str(row.unit);
        for (const Setting& s : settings_of(k))
          out[s.name] = s.unit;
        return out;
      },
      arg("kind"), "Unit of every parameter.");
}

}  // namespace mgdd::bindings
