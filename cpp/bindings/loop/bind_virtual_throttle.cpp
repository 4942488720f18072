// Binds loop/virtual_throttle.hpp: one sample of a throttle with its sensors at a time.
#include <array>
#include <cstdint>
#include <string>
#include <tuple>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/loop/virtual_throttle.hpp"

namespace mgdd::bindings {
namespace {

using namespace loop;

using Fault = std::tuple<std::string, double, double>;

throttle::SensorFault fault_from(const Fault& given) {
  const auto& [kind, from_s, size] = given;
  return {parse_name(throttle::sensor_fault_names(), "kind", kind), from_s, size};
}

py::dict to_dict(const VirtualThrottleSample& s, double sample_s) {
  py::dict out;
  out["time_s"] = static_cast<double>(s.sample) * sample_s;
  out["sensed_angle_deg"] = s.sensed.angle_deg;
  out["first_v"] = s.sensed.volts[0];
  out["second_v"] = s.sensed.volts[1];
  out["fault"] = s.sensed.fault;
  out["angle_deg"] = s.angle_deg;
  out["speed_deg_per_s"] = s.speed_deg_per_s;
  out["current_a"] = s.current_a;
  return out;
}

}  // namespace

void bind_virtual_throttle(py::module_& m) {
  py::class_<VirtualThrottle>(m, "VirtualThrottle",
                              "A throttle with its sensors, sample by sample; behind mgdd.loop.VirtualThrottle.")
      .def(py::init([](const throttle::Throttle& throttle, const throttle::SensorPair& sensors,
                       const std::array<Fault, 2>& faults, double sample_s, double step_s, double start_deg,
                       const std::string& bridge, std::uint64_t seed) {
             VirtualThrottleSettings s;
             s.throttle = throttle;
             s.sensors = sensors;
             s.faults = {fault_from(faults[0]), fault_from(faults[1])};
             s.sample_s = sample_s;
             s.step_s = step_s;
             s.start_deg = start_deg;
             s.bridge = parse_name(throttle::bridge_names(), "bridge", bridge);
             s.seed = seed;
             return VirtualThrottle(s);
           }),
           py::kw_only(), py::arg("throttle"), py::arg("sensors"), py::arg("faults"), py::arg("sample_s"),
           py::arg("step_s"), py::arg("start_deg"), py::arg("bridge"), py::arg("seed"))
      .def(
          "step",
          [](VirtualThrottle& t, double duty, double supply_v, double airflow_torque_nm) {
            return to_dict(t.step({duty, supply_v, airflow_torque_nm}), t.settings().sample_s);
          },
          py::arg("duty"), py::arg("supply_v"), py::arg("airflow_torque_nm"), "Run one sample.")
      .def_property_readonly("samples", &VirtualThrottle::samples, "Samples run so far.")
      .def_property(
          "state", [](const VirtualThrottle& t) { return save_state(t); },
          [](VirtualThrottle& t, const StateColumns& columns) { restore_state(t, columns); },
          "What a run needs to go on bit for bit.");
}

}  // namespace mgdd::bindings
