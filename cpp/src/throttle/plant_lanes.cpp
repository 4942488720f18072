#include "mgdd/throttle/plant_lanes.hpp"

#include <algorithm>
#include <bit>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::throttle {
namespace {

using Wide = PlantLanes::Wide;
using Coefficients = PlantCoefficients<double>;
constexpr auto lane_count = static_cast<std::size_t>(PlantLanes::width);
static_assert(sizeof(PlantCoefficients<Wide>) == n_plant_coefficients * sizeof(Wide));

PlantCoefficients<Wide> packed(const std::array<Coefficients, lane_count>& lanes) noexcept {
  std::array<Wide, n_plant_coefficients> columns{};
  for (int lane = 0; lane < PlantLanes::width; ++lane) {
    const auto flat = std::bit_cast<std::array<double, n_plant_coefficients>>(lanes[static_cast<std::size_t>(lane)]);
    for (std::size_t i = 0; i < n_plant_coefficients; ++i)
      columns[i].set(lane, flat[i]);
  }
  return std::bit_cast<PlantCoefficients<Wide>>(columns);
}

const ThrottleCase& case_in(std::span<const ThrottleCase> cases, std::size_t lane) noexcept {
  return cases[std::min(lane, cases.size() - 1)];
}

PlantLanes::Plant plant_of(std::span<const ThrottleCase> cases, double step_s) {
  require_within("number of throttles", static_cast<double>(cases.size()), 1.0, static_cast<double>(lane_count));
  require_within("step_s", step_s, step_lower_s, step_upper_s, "s");
  std::array<Coefficients, lane_count> coefficients{};
  Throttle options = cases[0].throttle;
  for (std::size_t lane = 0; lane < lane_count; ++lane) {
    const Throttle& one = case_in(cases, lane).throttle;
    validate(one);
    if (!same_form(one, cases[0].throttle)) {
      throw ParameterError("friction and backlash must have the same form in all cases of one call");
    }
    coefficients[lane] = plant_coefficients(one, step_s);
    options.pressure_drop_kpa = std::max(options.pressure_drop_kpa, one.pressure_drop_kpa);
  }
  return {packed(coefficients), options, step_s};
}

PlantLanes::State states_of(std::span<const ThrottleCase> cases) noexcept {
  PlantLanes::State out;
  const auto to = PlantLanes::Plant::numbers(out);
  for (int lane = 0; lane < PlantLanes::width; ++lane) {
    const auto from = PlantLanes::Plant::numbers(case_in(cases, static_cast<std::size_t>(lane)).start);
    for (std::size_t i = 0; i < to.size(); ++i)
      to[i]->set(lane, *from[i]);
  }
  return out;
}

}  // namespace

bool same_form(const Throttle& one, const Throttle& other) noexcept {
  return one.friction == other.friction && one.backlash == other.backlash;
}

PlantLanes::PlantLanes(std::span<const ThrottleCase> cases, double step_s)
    : plant_(plant_of(cases, step_s)), states_(states_of(cases)) {}

void PlantLanes::step(const Inputs& inputs, std::size_t steps) noexcept {
  dispatch([&]() MGDD_INLINE_LAMBDA {
    State s = states_;
    const BasicThrottleInput<Wide> input{.duty = Wide::load(inputs.duty.data()),
                                         .supply_v = Wide::load(inputs.supply_v.data()),
                                         .airflow_torque_nm = Wide::load(inputs.airflow_torque_nm.data()),
                                         .bridge = inputs.bridge};
    for (std::size_t i = 0; i < steps; ++i)
      plant_.step(s, input);
    states_ = s;
  });
}

ThrottleState PlantLanes::state(std::size_t lane) const noexcept {
  ThrottleState out;
  const auto to = ThrottlePlant::numbers(out);
  const auto from = Plant::numbers(states_);
  for (std::size_t i = 0; i < to.size(); ++i)
    *to[i] = (*from[i])[static_cast<int>(lane)];
  return out;
}

double PlantLanes::angle_deg(std::size_t lane) const noexcept {
  return states_.plate_angle_rad[static_cast<int>(lane)] * (1.0 / units::rad_per_deg);
}

}  // namespace mgdd::throttle
