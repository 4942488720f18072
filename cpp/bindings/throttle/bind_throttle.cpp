// Binds include/mgdd/throttle: the parameter record, and runs over sampled inputs without the GIL.
#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/throttle/plant.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace throttle;

constexpr std::size_t steps_between_looks = 200'000;

void bind_throttle_record(py::module_& m) {
  py::class_<Throttle> cls(m, "Throttle",
                           R"(Parameters of an electronic throttle body, seen from the plate shaft.

Keyword-only and immutable; units stand in the names. Angles are degrees from mechanically closed, opening positive.
Defaults are the preset `P1`. `Throttle.fields()` lists every field with unit, bounds, meaning and default.

Raises
------
mgdd.errors.ParameterError
    A field outside its domain, naming field, value and bound.

Examples
--------
>>> from mgdd.throttle import Throttle
>>> t = Throttle(limp_home_deg=10.0, friction="stribeck", stiction_nm=0.3)
>>> t
Throttle(stiction_nm=0.3, limp_home_deg=10.0, friction='stribeck')
>>> t.replace(supply_v=14.4).supply_v
14.4
)");
  bind_record(cls, "Throttle");
  cls.def_property_readonly("stall_torque_nm", &Throttle::stall_torque_nm,
                            "Stall torque per unit duty, g = K (V - V_drop)/R [N m].");
  cls.def_property_readonly("damping_nms_per_rad", &Throttle::damping_nms_per_rad,
                            "Viscous friction and braking by the shorted motor, b = K_v + K K_e/R [N m s/rad].");
  cls.def_property_readonly("plate", &plate_of, "What a controller can know of it: gain, springs, friction in duty.");
}

// Columns that live as long as a run; an empty one stands for "not given".
struct Inputs {
  Inputs(const InputArray& duty, const InputArray& supply, const InputArray& air, const std::string& bridge_name)
      : duty_column(to_column(duty, "duty")),
        supply_column(to_column(supply, "supply_v")),
        air_column(to_column(air, "airflow_torque_nm")),
        bridge(parse_name<Bridge>("bridge", bridge_name)) {
    if (duty_column.empty()) throw about("duty", ShapeError("duty has no samples"));
    validate({duty_column, supply_column, air_column, bridge});  // whole columns: `part` cuts what is checked
  }
  ThrottleSignals part(std::size_t from, std::size_t count) const {
    const auto cut = [&](const std::vector<double>& column) {
      return column.empty() ? std::span<const double>{} : std::span(column).subspan(from, count);
    };
    return {cut(duty_column), cut(supply_column), cut(air_column), bridge};
  }

  std::vector<double> duty_column, supply_column, air_column;
  Bridge bridge;
};

// Lets Ctrl-C through: whatever a signal handler raises ends the run.
void look_for_signals() {
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

double checked_start(const Throttle& t, double start_deg) {
  require_within("start_deg", start_deg, t.closed_deg, t.open_deg, "deg");
  return start_deg;
}

py::dict simulate_one(const Throttle& t, const InputArray& duty, double sample_s, double start_deg,
                      const std::string& bridge, const InputArray& supply_v, const InputArray& airflow_torque_nm,
                      double step_s) {
  const Inputs inputs(duty, supply_v, airflow_torque_nm, bridge);
  const std::size_t steps = steps_per_sample(sample_s, step_s);
  const ThrottlePlant plant(t, step_s);
  ThrottleState state = at_rest(checked_start(t, start_deg));
  const std::size_t n = inputs.duty_column.size();
  std::vector<double> angle(n), speed(n), current(n);
  {
    const py::gil_scoped_release release;
    const std::size_t chunk = std::max<std::size_t>(1, steps_between_looks / steps);
    // The last sample of a chunk is the first of the next: its inputs act from there.
    for (std::size_t from = 0;; from += chunk) {
      const std::size_t count = std::min(chunk + 1, n - from);
      const auto cut = [&](std::vector<double>& column) { return std::span(column).subspan(from, count); };
      simulate(plant, inputs.part(from, count), steps, state, {cut(angle), cut(speed), cut(current)});
      if (from + count == n) break;
      look_for_signals();
    }
  }
  py::dict out;
  out["angle_deg"] = to_array(angle);
  out["speed_deg_per_s"] = to_array(speed);
  out["current_a"] = to_array(current);
  return out;
}

py::array_t<double> simulate_lanes(const std::vector<Throttle>& throttles, const InputArray& duty, double sample_s,
                                   const InputArray& start_deg, const std::string& bridge, const InputArray& supply_v,
                                   const InputArray& airflow_torque_nm, double step_s) {
  const Inputs inputs(duty, supply_v, airflow_torque_nm, bridge);
  const std::size_t steps = steps_per_sample(sample_s, step_s);
  const std::vector<double> starts = to_column(start_deg, "start_deg");
  if (starts.size() != throttles.size()) {
    throw about("start_deg", ShapeError("start_deg has " + std::to_string(starts.size()) + " entries, there are " +
                                        std::to_string(throttles.size()) + " throttles"));
  }
  std::vector<ThrottleCase> cases;
  for (std::size_t i = 0; i < throttles.size(); ++i) {
    if (throttles[i].friction != throttles[0].friction || throttles[i].backlash != throttles[0].backlash) {
      throw ParameterError("throttle " + std::to_string(i) +
                           ": friction and backlash must have the same form in all throttles of one call");
    }
    cases.push_back({throttles[i], at_rest(checked_start(throttles[i], starts[i]))});
  }
  const std::size_t n = inputs.duty_column.size();
  py::array_t<double> out({static_cast<py::ssize_t>(cases.size()), static_cast<py::ssize_t>(n)});
  double* at = out.mutable_data();
  {
    const py::gil_scoped_release release;
    constexpr std::size_t cases_between_looks = 64;
    for (std::size_t from = 0; from < cases.size(); from += cases_between_looks) {
      const std::size_t count = std::min(cases_between_looks, cases.size() - from);
      const std::vector<double> rows =
          simulate_many(std::span(cases).subspan(from, count), inputs.part(0, n), steps, step_s);
      at = std::copy(rows.begin(), rows.end(), at);
      look_for_signals();
    }
  }
  return out;
}

py::array_t<double> air_torque(const Throttle& t, const InputArray& angle_deg) {
  std::vector<double> torque = to_column(angle_deg, "angle_deg");
  {
    const py::gil_scoped_release release;
    for (double& value : torque)
      value = airflow_torque_nm(t, value);
  }
  return to_array(torque);
}

}  // namespace

void bind_throttle(py::module_& m) {
  bind_throttle_record(m);
  m.def("simulate", &simulate_one, py::arg("throttle"), py::arg("duty"), py::kw_only(), py::arg("sample_s"),
        py::arg("start_deg"), py::arg("bridge"), py::arg("supply_v"), py::arg("airflow_torque_nm"), py::arg("step_s"),
        "One throttle over columns, from rest; behind mgdd.throttle.simulate_throttle.");
  m.def("simulate_many", &simulate_lanes, py::arg("throttles"), py::arg("duty"), py::kw_only(), py::arg("sample_s"),
        py::arg("start_deg"), py::arg("bridge"), py::arg("supply_v"), py::arg("airflow_torque_nm"), py::arg("step_s"),
        "Many throttles under one input, in lanes; behind mgdd.throttle.simulate_throttle.");
  m.def("airflow_torque", &air_torque, py::arg("throttle"), py::arg("angle_deg"),
        "Torque of the modelled air flow [N m]; behind mgdd.throttle.airflow_torque_nm.");
}

}  // namespace mgdd::bindings
