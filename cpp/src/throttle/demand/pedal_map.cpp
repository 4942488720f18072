#include "mgdd/throttle/demand/pedal_map.hpp"

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/math/tables.hpp"

namespace mgdd::throttle {
namespace {

constexpr Domain pedal_domain = closed(0.0, 100.0);
constexpr Domain speed_domain = above(0.0, 50000.0);
constexpr Domain torque_domain = closed(-1e5, 1e5);

void require_axis_in(const std::string& name, std::span<const double> axis, const Domain& domain,
                     std::string_view unit) {
  require_axis(name, axis);
  for (std::size_t i = 0; i < axis.size(); ++i)
    require_in(domain, name + "[" + std::to_string(i) + "]", axis[i], unit);
}

}  // namespace

std::vector<double> progressive_torque_nm(std::span<const double> pedal_percent, std::span<const double> speed_rpm,
                                          std::span<const double> full_load_nm) {
  if (full_load_nm.size() != speed_rpm.size()) {
    throw about("full_load_nm", ShapeError("full_load_nm has " + std::to_string(full_load_nm.size()) +
                                           " entries, speed_rpm has " + std::to_string(speed_rpm.size())));
  }
  std::vector<double> wanted;
  wanted.reserve(pedal_percent.size() * speed_rpm.size());
  for (const double percent : pedal_percent) {
    const double p = 0.01 * percent;
    for (std::size_t i = 0; i < speed_rpm.size(); ++i) {
      const double braking = 0.1 * (1.0 - p) * speed_rpm[i] / speed_rpm.back();
      wanted.push_back(full_load_nm[i] * (0.6 * p + 0.4 * p * p - braking));
    }
  }
  return wanted;
}

double PedalMap::torque_nm(double pedal, double speed) const noexcept {
  if (!std::isfinite(pedal) || !std::isfinite(speed)) return std::numeric_limits<double>::quiet_NaN();
  return place_in(pedal_percent, speed_rpm, pedal, speed).value_of(wanted_nm);
}

void validate(const PedalMap& map) {
  require_axis_in("pedal_percent", map.pedal_percent, pedal_domain, "%");
  require_axis_in("speed_rpm", map.speed_rpm, speed_domain, "rpm");
  const std::size_t columns = map.speed_rpm.size();
  if (map.wanted_nm.size() != map.pedal_percent.size() * columns) {
    throw about("wanted_nm", ShapeError("wanted_nm has " + std::to_string(map.wanted_nm.size()) +
                                        " entries: must have one per pedal and speed, " +
                                        std::to_string(map.pedal_percent.size() * columns)));
  }
  for (std::size_t i = 0; i < map.wanted_nm.size(); ++i) {
    const std::string entry = "wanted_nm[" + std::to_string(i / columns) + "][" + std::to_string(i % columns) + "]";
    require_in(torque_domain, entry, map.wanted_nm[i], "N m");
    if (i >= columns && !(map.wanted_nm[i] >= map.wanted_nm[i - columns])) {
      throw ParameterError(entry, map.wanted_nm[i],
                           "must not be below " + text(map.wanted_nm[i - columns]) + " N m of less pedal", "N m");
    }
  }
}

}  // namespace mgdd::throttle
