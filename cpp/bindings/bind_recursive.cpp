// Binds include/mgdd/identify/throttle/pseudo_wiener_fit.hpp and recursive_*.hpp: the fit and the on-line update.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/identify/online/recursive_gradient.hpp"
#include "mgdd/identify/online/recursive_pw_r.hpp"
#include "mgdd/identify/online/recursive_window.hpp"
#include "mgdd/identify/throttle/pseudo_wiener_fit.hpp"
#include "pseudo_wiener_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace mgdd::identify;
using Numbers = std::map<std::string, double>;

throttle::PwR pw_r(const Numbers& parameters) {
  return std::get<throttle::PwR>(make_pseudo_wiener("pw_r", parameters, "predicted", "set_valued"));
}

std::array<bool, 5> free_flags(const std::vector<std::string>& names) {
  constexpr std::array<std::string_view, 5> known{"tau_s", "gain_deg_per_s2_per_duty", "preload_duty",
                                                  "spring_duty_per_deg", "coulomb_duty"};
  std::array<bool, 5> flags{};
  for (const std::string& name : names) {
    const auto found = std::find(known.begin(), known.end(), name);
    if (found == known.end()) throw ParameterError("free: '" + name + "' is no parameter of pw_r that can be updated");
    flags[static_cast<std::size_t>(found - known.begin())] = true;
  }
  return flags;
}

std::pair<std::vector<double>, std::vector<double>> columns(const InputArray& duty, const InputArray& angle) {
  auto u = to_column(duty, "duty");
  auto y = to_column(angle, "angle_deg");
  if (u.size() != y.size()) {
    throw ShapeError("duty has " + std::to_string(u.size()) + " samples: angle_deg has " + std::to_string(y.size()));
  }
  return {std::move(u), std::move(y)};
}

struct WindowUpdate {
  WindowPwR core;
  std::int64_t iterate_every;
  std::int64_t count = 0;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    WindowPwR::visit(self.core, v);
    v("calls", self.count);
  }
};
struct GradientUpdate {
  GradientPwR core;
  bool started = false;
  double duty = 0.0;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    GradientPwR::visit(self.core, v);
    v("started", self.started);
    v("last_duty", self.duty);
  }
};

// `update(self, duty, angle) -> count` over whole columns, parameters and state: the same face for all three.
template <class Online, class Update, class Model>
void bind_online(py::class_<Online>& cls, Update update, Model model) {
  using py::arg;
  cls.def(
      "update",
      [update](Online& self, const InputArray& duty, const InputArray& angle) {
        const auto [u, y] = columns(duty, angle);
        std::int64_t changed = 0;
        for (std::size_t k = 0; k < u.size(); ++k)
          changed += update(self, u[k], y[k]) ? 1 : 0;
        return changed;
      },
      arg("duty"), arg("angle_deg"), "Takes samples in order; returns how many changed the model.");
  cls.def_property_readonly("parameters",
                            [model](const Online& self) { return parameters_of(throttle::PseudoWiener(model(self))); });
  cls.def("state", [](const Online& self) { return save_state(self); });
  cls.def("restore", [](Online& self, const StateColumns& state) { restore_state(self, state); }, arg("state"));
}

}  // namespace

void bind_recursive(py::module_& m) {
  using py::arg;

  m.def(
      "fit_pseudo_wiener",
      [](const std::string& kind, const std::vector<std::pair<InputArray, InputArray>>& records,
         const Numbers& parameters, const std::string& sides, const std::vector<std::string>& free,
         const std::vector<double>& delays, int starts, std::uint64_t seed, bool only_given_start, bool try_map_start,
         int max_iterations) {
        std::vector<ThrottleRecord> logs;
        for (const auto& [duty, angle] : records) {
          auto [u, y] = columns(duty, angle);
          logs.push_back({std::move(u), std::move(y)});
        }
        PseudoWienerFitOptions o;
        o.sides = parse_name(sides_names(), "sides", sides);
        o.free = free;
        o.delays = delays;
        o.starts = starts;
        o.seed = seed;
        o.only_given_start = only_given_start;
        o.try_lag_starts = try_map_start;
        o.search.max_iterations = max_iterations;
        const auto base = make_pseudo_wiener(kind, parameters, "predicted", "set_valued");
        PseudoWienerFit fit;
        {
          const py::gil_scoped_release release;
          fit = fit_pseudo_wiener(logs, base, o);
        }
        return py::make_tuple(parameters_of(fit.model), fit.report, to_array(fit.rmse_deg), fit.hits);
      },
      py::kw_only(), arg("kind"), arg("records"), arg("parameters"), arg("sides"), arg("free"), arg("delays"),
      arg("starts"), arg("seed"), arg("only_given_start"), arg("try_map_start"), arg("max_iterations"),
      "Output-error fit from several starts: parameters, report, RMSE of every search, hits of the best.");

  py::class_<RecursivePwR> rls(m, "RecursivePwR", "Recursive least squares of PW-R; use mgdd.identify.OnlineUpdate.");
  rls.def(py::init([](const Numbers& parameters, const std::vector<std::string>& free, int every, double noise_deg,
                      double forgetting) {
            RecursivePwRSettings s;
            s.model = pw_r(parameters);
            s.free = free_flags(free);
            s.every = every;
            s.noise_deg = noise_deg;
            s.forgetting = forgetting;
            return RecursivePwR(s);
          }),
          arg("parameters"), py::kw_only(), arg("free"), arg("every"), arg("noise_deg"), arg("forgetting"));
  bind_online(
      rls, [](RecursivePwR& o, double u, double y) { return o.update(u, y) == UpdateGate::updated; },
      [](const RecursivePwR& o) { return o.model(); });

  py::class_<WindowUpdate> window(m, "WindowPwR", "Sliding-window fit of PW-R; use mgdd.identify.OnlineUpdate.");
  window.def(py::init([](const Numbers& parameters, const std::vector<std::string>& free, int every, double noise_deg,
                         double prior_spread, std::int64_t iterate_every) {
               WindowPwRSettings s;
               s.model = pw_r(parameters);
               s.free = free_flags(free);
               s.every = every;
               s.noise_deg = noise_deg;
               s.prior_spread = prior_spread;
               if (iterate_every < 1) {
                 throw ParameterError("iterate_every = " + std::to_string(iterate_every) + " samples: must be >= 1");
               }
               return WindowUpdate{WindowPwR(s), iterate_every};
             }),
             arg("parameters"), py::kw_only(), arg("free"), arg("every"), arg("noise_deg"), arg("prior_spread"),
             arg("iterate_every"));
  bind_online(
      window,
      [](WindowUpdate& o, double u, double y) {
        static_cast<void>(o.core.update(u, y));
        return ++o.count % o.iterate_every == 0 && o.core.iterate();
      },
      [](const WindowUpdate& o) { return o.core.model(); });

  py::class_<GradientUpdate> gradient(m, "GradientPwR", "Gradient update of PW-R; use mgdd.identify.OnlineUpdate.");
  gradient.def(py::init([](const Numbers& parameters, const std::vector<std::string>& free, double adaptation_gain,
                           double noise_deg) {
                 GradientPwRSettings s;
                 s.model = pw_r(parameters);
                 s.free = free_flags(free);
                 s.adaptation_gain = adaptation_gain;
                 s.least_error_deg = 3.0 * noise_deg;
                 return GradientUpdate{GradientPwR(s)};
               }),
               arg("parameters"), py::kw_only(), arg("free"), arg("adaptation_gain"), arg("noise_deg"));
  bind_online(
      gradient,
      [](GradientUpdate& o, double u, double y) {
        if (!o.started) {
          if (!std::isfinite(y) || !std::isfinite(u)) return false;  // a dropped sample is nowhere to start
          o.core.start(y, u);
          o.started = true;
          o.duty = u;
          return false;
        }
        const auto before = o.core.factors();
        static_cast<void>(o.core.update(o.duty, y));
        o.duty = u;
        return o.core.factors() != before;
      },
      [](const GradientUpdate& o) { return o.core.model(); });
}

}  // namespace mgdd::bindings
