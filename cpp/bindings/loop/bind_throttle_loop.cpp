// Binds include/mgdd/loop/throttle_controllers.hpp: a controller on the virtual throttle without the GIL, many of them
// on all cores.
#include <algorithm>
#include <array>
#include <chrono>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "interruptible.hpp"
#include "loop/throttle_controller_binding.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::bindings {

using namespace loop;

ThrottleController controller_of(const py::handle& object) {
  if (py::isinstance<control::GuidedPredictive>(object)) return object.cast<const control::GuidedPredictive&>();
  if (py::isinstance<control::Pid>(object)) return object.cast<const control::Pid&>();
  if (py::isinstance<control::SlidingMode>(object)) return object.cast<const control::SlidingMode&>();
  if (py::isinstance<BoundMgdd1>(object)) {
    return std::visit([](const auto& c) -> ThrottleController { return c; },
                      object.cast<const BoundMgdd1&>().controller);
  }
  refuse("controller", object, "a controller of mgdd.control");
}

void give_back(const py::handle& object, const ThrottleController& controller) {
  std::visit(
      [&]<class C>(const C& c) {
        if constexpr (std::is_constructible_v<AnyMgdd1, C>) {
          object.cast<BoundMgdd1&>().controller = c;
        } else {
          object.cast<C&>() = c;
        }
      },
      controller);
}

namespace {

ThrottleScenario scenario_of(const InputArray& reference, const InputArray& airflow, const InputArray& supply,
                             std::size_t from) {
  return {to_column(reference, "reference_deg"), to_column(airflow, "airflow_torque_nm"), to_column(supply, "supply_v"),
          from};
}

template <class Figures>
py::dict to_dict(const Figures& all) {
  using F = TrackingFigures;
  py::dict out;
  const auto put = [&](const char* name, double F::* member) {
    std::vector<double> column(all.size());
    std::ranges::transform(all, column.begin(), [&](const F& f) { return f.*member; });
    out[name] = to_array(column);
  };
  put("settling_ms", &F::settling_ms);
  put("mse_deg2", &F::mse_deg2);
  put("static_error_deg", &F::static_error_deg);
  put("overshoot_deg", &F::overshoot_deg);
  put("total_variation", &F::total_variation);
  put("limit_cycle_deg", &F::limit_cycle_deg);
  put("largest_error_deg", &F::largest_error_deg);
  return out;
}

py::dict run_one(const py::object& controller, const VirtualThrottle& plant, int delay_samples,
                 const InputArray& reference, const InputArray& airflow, const InputArray& supply, std::size_t from,
                 double band_deg) {
  const ThrottleScenario scenario = scenario_of(reference, airflow, supply, from);
  ThrottleController moved = controller_of(controller);
  const ThrottleTrack track = without_gil([&] {
    return std::visit([&](auto& c) { return run_throttle_loop(c, plant.settings(), delay_samples, scenario); }, moved);
  });
  give_back(controller, moved);
  py::dict out;
  out["angle_deg"] = to_array(track.angle_deg);
  out["sensed_angle_deg"] = to_array(track.sensed_angle_deg);
  out["speed_deg_per_s"] = to_array(track.speed_deg_per_s);
  out["current_a"] = to_array(track.current_a);
  out["duty"] = to_array(track.duty);
  out["figures"] = to_dict(std::array{tracking_figures(scenario, track, plant.settings().sample_s, band_deg)});
  return out;
}

using ScenarioColumns = std::tuple<InputArray, InputArray, InputArray, std::size_t>;

py::tuple track_many(const std::vector<VirtualThrottle*>& plants, const py::list& controllers,
                     const std::vector<ScenarioColumns>& scenarios, int delay_samples,
                     const std::vector<double>& band_deg, int threads) {
  ThrottleMonteCarlo plan;
  for (const VirtualThrottle* plant : plants)
    plan.plants.push_back(plant->settings());
  for (const py::handle& object : controllers)
    plan.controllers.push_back(controller_of(object));
  for (const auto& [reference, airflow, supply, from] : scenarios)
    plan.scenarios.push_back(scenario_of(reference, airflow, supply, from));
  plan.delay_samples = delay_samples;
  plan.band_deg = band_deg;
  plan.threads = threads;
  return hand_over(interruptible([&plan](const std::stop_token& stop) {
                     return monte_carlo(plan, [&stop] { return stop.stop_requested(); });
                   }),
                   [](const ThrottleMonteCarloResult& result) {
                     py::array_t<bool> finished(static_cast<py::ssize_t>(result.finished.size()));
                     std::copy(result.finished.begin(), result.finished.end(), finished.mutable_data());
                     return py::make_tuple(to_dict(result.figures), finished);
                   });
}

}  // namespace

void bind_throttle_loop(py::module_& m) {
  m.def("track_throttle", &run_one, py::arg("controller"), py::arg("plant"), py::kw_only(), py::arg("delay_samples"),
        py::arg("reference_deg"), py::arg("airflow_torque_nm"), py::arg("supply_v"), py::arg("from_sample"),
        py::arg("band_deg"), "Run a controller on a virtual throttle without the GIL; behind mgdd.loop.track.");
  m.def(
      "tracking_figures",
      [](const InputArray& reference, const InputArray& angle, const InputArray& duty, double sample_s,
         std::size_t from, double band_deg) {
        const ThrottleScenario scenario{to_column(reference, "reference_deg"), {}, {}, from};
        validate(scenario);
        ThrottleTrack track;
        track.angle_deg = to_column(angle, "angle_deg");
        track.duty = to_column(duty, "duty");
        for (const auto* column : {&track.angle_deg, &track.duty}) {
          if (column->size() != scenario.reference_deg.size()) {
            throw ShapeError("angle_deg and duty must have as many samples as reference_deg");
          }
        }
        py::dict out;
        for (const auto& [name, column] : to_dict(std::array{tracking_figures(scenario, track, sample_s, band_deg)}))
          out[name] = column.attr("__getitem__")(0);
        return out;
      },
      py::kw_only(), py::arg("reference_deg"), py::arg("angle_deg"), py::arg("duty"), py::arg("sample_s"),
      py::arg("from_sample"), py::arg("band_deg"), "How well a reference was followed.");
  m.def(
      "step_times_us",
      [](const py::object& controller, const InputArray& reference, const InputArray& measured) {
        const auto r = to_column(reference, "reference_deg"), y = to_column(measured, "measured_deg");
        if (r.size() != y.size()) throw ShapeError("reference_deg and measured_deg must be of one length");
        std::vector<double> times(r.size());
        ThrottleController copy = controller_of(controller);
        without_gil([&] {
          std::visit(
              [&](auto& c) {
                for (std::size_t k = 0; k < r.size(); ++k) {
                  const auto start = std::chrono::steady_clock::now();
                  c.step(r[k], y[k]);
                  times[k] =
                      std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
                }
              },
              copy);
          return 0;
        });
        return to_array(times);
      },
      py::arg("controller"), py::arg("reference_deg"), py::arg("measured_deg"),
      "Time of every step of a copy of the controller [us].");
  m.def("track_throttles", &track_many, py::arg("plants"), py::arg("controllers"), py::arg("scenarios"), py::kw_only(),
        py::arg("delay_samples"), py::arg("band_deg"), py::arg("threads"),
        "Whole loops on all cores; behind mgdd.loop.track_many.");
}

}  // namespace mgdd::bindings
