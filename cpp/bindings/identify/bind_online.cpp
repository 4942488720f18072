// Binds identify/throttle/pseudo_wiener_fit.hpp and identify/online/online_update.hpp: the fit and the on-line update.
#include <map>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "interruptible.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/identify/online/online_update.hpp"
#include "mgdd/identify/throttle/pseudo_wiener_fit.hpp"
#include "mgdd/throttle/models/pseudo_wiener_numbers.hpp"
#include "throttle/pseudo_wiener_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace mgdd::identify;
using Numbers = std::map<std::string, double>;

throttle::PwR pw_r(const Numbers& parameters) {
  return std::get<throttle::PwR>(throttle::pseudo_wiener_from("pw_r", parameters));
}

std::pair<std::vector<double>, std::vector<double>> columns(const InputArray& duty, const InputArray& angle) {
  auto u = to_column(duty, "duty");
  auto y = to_column(angle, "angle_deg");
  if (u.size() != y.size()) {
    throw about("duty", ShapeError("duty has " + std::to_string(u.size()) + " samples: angle_deg has " +
                                   std::to_string(y.size())));
  }
  return {std::move(u), std::move(y)};
}

// Whole columns without the GIL, parameters and state: the same face for all three.
template <class Update>
void bind_online(py::class_<Guarded<Update>>& cls) {
  using py::arg;
  using B = Guarded<Update>;
  cls.def(
      "update",
      [](B& b, const InputArray& duty, const InputArray& angle) {
        const auto [u, y] = columns(duty, angle);
        const auto update = b.use();
        const py::gil_scoped_release release;
        return take(*update, u, y);
      },
      arg("duty"), arg("angle_deg"), "Takes samples in order, without the GIL; returns how many changed the model.");
  cls.def_property_readonly("parameters", [](const B& b) {
    const throttle::PseudoWiener model = b.use()->model();
    return parameters_of(model);
  });
  cls.def("state", [](const B& b) { return save_state(*b.use()); });
  cls.def("restore", [](B& b, const StateColumns& state) { restore_state(*b.use(), state); }, arg("state"));
}

}  // namespace

void bind_online(py::module_& m) {
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
        o.sides = parse_name<Sides>("sides", sides);
        o.free = free;
        o.delays = delays;
        o.starts = starts;
        o.seed = seed;
        o.only_given_start = only_given_start;
        o.try_lag_starts = try_map_start;
        o.search.max_iterations = max_iterations;
        const auto base = throttle::pseudo_wiener_from(kind, parameters);
        return hand_over(interruptible([&](std::stop_token stop) {
                           o.search.stop = std::move(stop);
                           return fit_pseudo_wiener(logs, base, o);
                         }),
                         [](const PseudoWienerFit& fit) {
                           return py::make_tuple(parameters_of(fit.model), fit.report, to_array(fit.rmse_deg),
                                                 fit.n_best);
                         });
      },
      py::kw_only(), arg("kind"), arg("records"), arg("parameters"), arg("sides"), arg("free"), arg("delays"),
      arg("starts"), arg("seed"), arg("only_given_start"), arg("try_map_start"), arg("max_iterations"),
      "Output-error fit from several starts: parameters, report, RMSE of every search, count that reached the best.");

  py::class_<Guarded<RecursiveUpdate>> rls(m, "RecursivePwR",
                                           "Recursive least squares of PW-R; use mgdd.identify.OnlineUpdate.");
  rls.def(py::init([](const Numbers& parameters, const std::vector<std::string>& free, int every, double noise_deg,
                      double forgetting) {
            RecursivePwRSettings s;
            s.model = pw_r(parameters);
            s.free = free_groups(free);
            s.every = every;
            s.noise_deg = noise_deg;
            s.forgetting = forgetting;
            return Guarded<RecursiveUpdate>("OnlineUpdate", RecursiveUpdate(s));
          }),
          arg("parameters"), py::kw_only(), arg("free"), arg("every"), arg("noise_deg"), arg("forgetting"));
  bind_online(rls);

  py::class_<Guarded<WindowUpdate>> window(m, "WindowPwR",
                                           "Sliding-window fit of PW-R; use mgdd.identify.OnlineUpdate.");
  window.def(py::init([](const Numbers& parameters, const std::vector<std::string>& free, int every, double noise_deg,
                         double prior_spread, std::int64_t iterate_every) {
               WindowPwRSettings s;
               s.model = pw_r(parameters);
               s.free = free_groups(free);
               s.every = every;
               s.noise_deg = noise_deg;
               s.prior_spread = prior_spread;
               return Guarded<WindowUpdate>("OnlineUpdate", WindowUpdate(s, iterate_every));
             }),
             arg("parameters"), py::kw_only(), arg("free"), arg("every"), arg("noise_deg"), arg("prior_spread"),
             arg("iterate_every"));
  bind_online(window);

  py::class_<Guarded<GradientUpdate>> gradient(m, "GradientPwR",
                                               "Gradient update of PW-R; use mgdd.identify.OnlineUpdate.");
  gradient.def(py::init([](const Numbers& parameters, const std::vector<std::string>& free, double adaptation_gain,
                           double noise_deg) {
                 GradientPwRSettings s;
                 s.model = pw_r(parameters);
                 s.free = free_groups(free);
                 s.adaptation_gain = adaptation_gain;
                 s.least_error_deg = noise_sigmas * noise_deg;
                 return Guarded<GradientUpdate>("OnlineUpdate", GradientUpdate(s));
               }),
               arg("parameters"), py::kw_only(), arg("free"), arg("adaptation_gain"), arg("noise_deg"));
  bind_online(gradient);
}

}  // namespace mgdd::bindings
