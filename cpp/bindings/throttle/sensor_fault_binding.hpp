// Fault of a sensor as Python hands it over: kind, onset [s], size, and end [s] or None.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <tuple>

#include "binding.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/throttle/sensors.hpp"

namespace mgdd::bindings {

using SensorFaultArgument = std::tuple<std::string, double, double, std::optional<double>>;

inline throttle::SensorFault sensor_fault_from(const SensorFaultArgument& given) {
  const auto& [kind, from_s, size, until_s] = given;
  return {parse_name<throttle::SensorFaultKind>("kind", kind), from_s, size, until_s};
}

inline std::array<throttle::SensorFault, 2> sensor_faults_from(const std::array<SensorFaultArgument, 2>& given) {
  return {sensor_fault_from(given[0]), sensor_fault_from(given[1])};
}

}  // namespace mgdd::bindings
