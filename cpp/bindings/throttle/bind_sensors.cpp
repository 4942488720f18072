// Binds throttle/sensors.hpp: settings of the sensor pair, and samples of a whole run without the GIL.
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/throttle/sensors.hpp"
#include "record_binding.hpp"
#include "throttle/sensor_fault_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace throttle;

template <class Of>
py::array_t<double> volts(const std::vector<SensorReading>& rows, Of of) {
  py::array_t<double> out(static_cast<py::ssize_t>(rows.size()));
  double* at = out.mutable_data();
  for (const SensorReading& row : rows)
    *at++ = of(row);
  return out;
}

template <class Of>
py::array_t<bool> flags(const std::vector<SensorReading>& rows, Of of) {
  py::array_t<bool> out(static_cast<py::ssize_t>(rows.size()));
  bool* at = out.mutable_data();
  for (const SensorReading& row : rows)
    *at++ = of(row);
  return out;
}

py::dict sense(const SensorPair& pair, const InputArray& angle_deg, double sample_s, std::uint64_t seed,
               const std::array<SensorFaultArgument, 2>& faults) {
  const std::vector<double> angle = to_column(angle_deg, "angle_deg");
  SensorSampler sampler(pair, sample_s, seed, sensor_faults_from(faults));
  std::vector<SensorReading> rows;
  rows.reserve(angle.size());
  {
    const py::gil_scoped_release release;
    for (const double value : angle)
      rows.push_back(sampler.step(value));
  }
  py::dict out;
  out["first_v"] = volts(rows, [](const SensorReading& r) { return r.volts[0]; });
  out["second_v"] = volts(rows, [](const SensorReading& r) { return r.volts[1]; });
  out["sensed_angle_deg"] = volts(rows, [](const SensorReading& r) { return r.angle_deg; });
  out["sum_error_v"] = volts(rows, [](const SensorReading& r) { return r.sum_error_v; });
  out["first_range_fault"] = flags(rows, [](const SensorReading& r) { return r.range_fault[0]; });
  out["second_range_fault"] = flags(rows, [](const SensorReading& r) { return r.range_fault[1]; });
  out["sum_fault"] = flags(rows, [](const SensorReading& r) { return r.sum_fault; });
  out["fault"] = flags(rows, [](const SensorReading& r) { return r.fault; });
  return out;
}

}  // namespace

void bind_sensors(py::module_& m) {
  py::class_<SensorPair> cls(m, "SensorPair",
                             R"(Two redundant position sensors of a throttle with opposite slopes, and their check.

Keyword-only and immutable. The first gives ``closed_v + span_v angle/travel_deg``, the second ``supply_v`` minus that.

Parameters
----------
closed_v, span_v : float
    First sensor at 0 deg, and its rise over the travel [V]; 0 and 5 are the ideal form of catalogues.
travel_deg : float
    Angle of the full span [deg].
supply_v : float
    Supply of sensors and converter [V].
noise_v : float
    Noise at the converter, rms of each sensor [V].
lag_s : float
    Time constant of the anti-alias filter [s].
adc_bits : int
    Bits of the converter, 4 to 24.
sum_tolerance_v : float
    The sum may differ from the supply by less than this [V].
low_v, high_v : float
    Range of a healthy sensor [V].
debounce_s : float
    So long a check must fail before the fault counts [s]; a sample that passes takes back half of one.

Raises
------
mgdd.errors.ParameterError
    A field outside its domain, naming field, value and bound.

Examples
--------
>>> from mgdd.throttle import SensorPair
>>> SensorPair().adc_bits
12
)");
  using P = SensorPair;
  bind_record(cls, "SensorPair");
  cls.def_property_readonly("lsb_v", &P::lsb_v, "Step of the converter [V].");
  py::list kinds;
  for (const auto& [kind, name] : names<SensorFaultKind>())
    kinds.append(as_str(name));
  m.attr("sensor_fault_kinds") = py::tuple(kinds);
  m.def("sense", &sense, py::arg("pair"), py::arg("angle_deg"), py::kw_only(), py::arg("sample_s"), py::arg("seed"),
        py::arg("faults"), "Samples of both sensors; behind mgdd.throttle.SensorPair.sense.");
}

}  // namespace mgdd::bindings
