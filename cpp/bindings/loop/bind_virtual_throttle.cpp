// Binds loop/virtual_throttle.hpp: one sample of a throttle with its sensors at a time.
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "throttle/sensor_fault_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace loop;

using PlantFault = std::tuple<std::string, double, double, std::optional<double>>;

ThrottleFault fault_from(const PlantFault& given) {
  const auto& [kind, from_s, size, until_s] = given;
  return {parse_name<ThrottleFaultKind>("kind", kind), from_s, size, until_s};
}

py::dict to_dict(const VirtualThrottleSample& s, const VirtualThrottleSettings& settings) {
  const std::array<double, 2> angles_deg = settings.sensors.angles_deg(s.sensed.volts);
  py::dict out;
  out["time_s"] = static_cast<double>(s.sample) * settings.sample_s;
  out["sensed_angle_deg"] = s.sensed.angle_deg;
  out["first_v"] = s.sensed.volts[0];
  out["second_v"] = s.sensed.volts[1];
  out["first_angle_deg"] = angles_deg[0];
  out["second_angle_deg"] = angles_deg[1];
  out["fault"] = s.sensed.fault;
  out["age_s"] = s.age_s;
  out["supply_v"] = s.supply_v;
  out["angle_deg"] = s.angle_deg;
  out["speed_deg_per_s"] = s.speed_deg_per_s;
  out["current_a"] = s.current_a;
  return out;
}

}  // namespace

void bind_virtual_throttle(py::module_& m) {
  py::list kinds;
  for (const auto& [kind, name] : names<ThrottleFaultKind>())
    kinds.append(as_str(name));
  m.attr("throttle_fault_kinds") = py::tuple(kinds);
  py::class_<VirtualThrottle>(m, "VirtualThrottle",
                              "A throttle with its sensors, sample by sample; behind mgdd.loop.VirtualThrottle.")
      .def(
          py::init([](const throttle::Throttle& throttle, const throttle::SensorPair& sensors,
                      const std::array<SensorFaultArgument, 2>& faults, const std::vector<PlantFault>& plant_faults,
                      double sample_s, double step_s, double start_deg, const std::string& bridge, std::uint64_t seed) {
            VirtualThrottleSettings s;
            s.throttle = throttle;
            s.sensors = sensors;
            s.faults = sensor_faults_from(faults);
            for (const PlantFault& fault : plant_faults)
              s.plant_faults.push_back(fault_from(fault));
            s.sample_s = sample_s;
            s.step_s = step_s;
            s.start_deg = start_deg;
            s.bridge = parse_name<throttle::Bridge>("bridge", bridge);
            s.seed = seed;
            return VirtualThrottle(s);
          }),
          py::kw_only(), py::arg("throttle"), py::arg("sensors"), py::arg("faults"), py::arg("plant_faults"),
          py::arg("sample_s"), py::arg("step_s"), py::arg("start_deg"), py::arg("bridge"), py::arg("seed"))
      .def(
          "step",
          [](VirtualThrottle& t, double duty, double supply_v, double airflow_torque_nm, bool bridge_open) {
            return to_dict(t.step({duty, supply_v, airflow_torque_nm, bridge_open}), t.settings());
          },
          py::kw_only(), py::arg("duty"), py::arg("supply_v"), py::arg("airflow_torque_nm"), py::arg("bridge_open"),
          "Run one sample.")
      .def_property_readonly("samples", &VirtualThrottle::samples, "Samples run so far.")
      .def_property(
          "state", [](const VirtualThrottle& t) { return save_state(t); },
          [](VirtualThrottle& t, const StateColumns& columns) { restore_state(t, columns); },
          "What a run needs to go on bit for bit.");
}

}  // namespace mgdd::bindings
