#include "mgdd/throttle/simulation.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::throttle {
namespace {

using Wide = PlantLanes::Wide;
using WidePlant = PlantLanes::Plant;
constexpr auto width = static_cast<std::size_t>(PlantLanes::width);

void check_column(std::string_view name, std::span<const double> column, std::size_t n, bool may_be_empty) {
  if (may_be_empty && column.empty()) return;
  if (column.size() != n) {
    throw about(name, ShapeError(std::string(name) + " has " + std::to_string(column.size()) + " samples, duty has " +
                                 std::to_string(n)));
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (!std::isfinite(column[k])) {
      throw about(name, DataError(std::string(name) + " is " + text(column[k]) + " at sample " + std::to_string(k) +
                                  ": must be finite"));
    }
  }
}

template <class Plant>
MGDD_INLINE typename Plant::Input input_at(const Plant& plant, const ThrottleSignals& signals, std::size_t k) noexcept {
  using T = typename Plant::Scalar;
  typename Plant::Input input = plant.input(T(signals.duty[k]));
  input.bridge = signals.bridge;
  if (!signals.supply_v.empty()) input.supply_v = T(signals.supply_v[k]);
  if (!signals.airflow_torque_nm.empty()) input.airflow_torque_nm = T(signals.airflow_torque_nm[k]);
  return input;
}

// The hot loop of many runs: rows of `width` angles per sample.
MGDD_INLINE void run_lanes(const WidePlant& plant, const ThrottleSignals& signals, std::size_t steps,
                           BasicThrottleState<Wide>& state, double* rows) noexcept {
  const dynamics::Repeated<WidePlant> sampled{plant, static_cast<int>(steps)};
  BasicThrottleState<Wide> s = state;
  const auto input = [&](std::size_t k) __attribute__((always_inline)) { return input_at(plant, signals, k); };
  const auto store = [rows](std::size_t k, const Wide& angle_deg) __attribute__((always_inline)) {
    angle_deg.store(rows + k * width);
    return true;
  };
  dynamics::run(sampled, s, signals.duty.size(), input, store);
  state = s;
}

}  // namespace

std::size_t steps_per_sample(double sample_s, double step_s) {
  require_within("step_s", step_s, step_lower_s, step_upper_s, "s");
  const double ratio = sample_s / step_s;
  const double whole = std::round(ratio);
  if (!(whole >= 1.0 && whole <= 1e9 && std::abs(ratio - whole) <= 1e-9 * whole)) {
    throw ParameterError("step_s", step_s,
                         "must go a whole number of times into the sample time of " + text(sample_s) + " s", "s");
  }
  return static_cast<std::size_t>(whole);
}

void validate(const ThrottleSignals& signals) {
  const std::size_t n = signals.duty.size();
  check_column("duty", signals.duty, n, false);
  check_column("supply_v", signals.supply_v, n, true);
  check_column("airflow_torque_nm", signals.airflow_torque_nm, n, true);
  for (std::size_t k = 0; k < n; ++k) {
    if (!(std::abs(signals.duty[k]) <= 1.0)) {
      throw about("duty", DataError("duty = " + text(signals.duty[k]) + " at sample " + std::to_string(k) +
                                    ": must be in [-1, 1]; a duty in percent is divided by 100"));
    }
    if (!signals.supply_v.empty() && !(signals.supply_v[k] >= 0.0)) {
      throw about("supply_v", DataError("supply_v = " + text(signals.supply_v[k]) + " V at sample " +
                                        std::to_string(k) + ": must be >= 0"));
    }
  }
}

void simulate(const ThrottlePlant& plant, const ThrottleSignals& signals, std::size_t steps, ThrottleState& state,
              const ThrottleColumns& columns) noexcept {
  constexpr double to_deg = 1.0 / units::rad_per_deg;
  const dynamics::Repeated<ThrottlePlant> sampled{plant, static_cast<int>(steps)};
  ThrottleState s = state;
  dynamics::run(
      sampled, s, signals.duty.size(), [&](std::size_t k) { return input_at(plant, signals, k); },
      [&](std::size_t k, double angle_deg) {
        if (!columns.angle_deg.empty()) columns.angle_deg[k] = angle_deg;
        if (!columns.speed_deg_per_s.empty()) columns.speed_deg_per_s[k] = s.plate_speed_rad_per_s * to_deg;
        if (!columns.current_a.empty()) columns.current_a[k] = s.current_a;
        return true;
      });
  state = s;
}

std::vector<double> simulate_many(std::span<const ThrottleCase> cases, const ThrottleSignals& signals,
                                  std::size_t steps, double step_s) {
  validate(signals);
  for (const ThrottleCase& one : cases) {
    if (!same_form(one.throttle, cases[0].throttle)) {
      throw ParameterError("friction and backlash must have the same form in all cases of one call");
    }
  }
  const std::size_t n = signals.duty.size();
  std::vector<double> angle_deg(cases.size() * n);
  std::vector<double> rows(width * n);
  for (std::size_t first = 0; first < cases.size(); first += width) {
    const std::size_t used = std::min(width, cases.size() - first);
    PlantLanes lanes(cases.subspan(first, used), step_s);
    dispatch([&]() MGDD_INLINE_LAMBDA { run_lanes(lanes.plant(), signals, steps, lanes.states(), rows.data()); });
    for (std::size_t lane = 0; lane < used; ++lane) {
      for (std::size_t k = 0; k < n; ++k)
        angle_deg[(first + lane) * n + k] = rows[k * width + lane];
    }
  }
  return angle_deg;
}

}  // namespace mgdd::throttle
