// What the bench refuses before it exists.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/loop/virtual_engine.hpp"

namespace mgdd::loop {
namespace {

// The refusal of another room, with the field of the bench in front.
template <class Check>
void check_member(const std::string& owner, Check check) {
  try {
    check();
  } catch (const ParameterError& error) {
    throw within(owner, error);
  }
}

void validate_schedule(const BenchSettings& s) {
  if (s.schedule.empty())
    throw about("schedule", ParameterError("schedule is empty: must have an operating point for cycle 0"));
  if (s.schedule.front().cycle != 0) {
    throw ParameterError("schedule[0].cycle", s.schedule.front().cycle, "must be 0");
  }
  const std::array<double, 2> window = timing_window(s.cylinder);
  for (std::size_t i = 0; i < s.schedule.size(); ++i) {
    const ScheduledPoint& now = s.schedule[i];
    const std::string owner = "schedule[" + std::to_string(i) + "]";
    if (i > 0 && now.cycle <= s.schedule[i - 1].cycle) {
      throw ParameterError(owner + ".cycle", now.cycle, "must be > " + std::to_string(s.schedule[i - 1].cycle));
    }
    check_member(owner, [&] { engine::validate_cycle(s.cylinder, now.point, window[1]); });
    if (!(now.point.fuel_mg > 0.0)) {
      throw ParameterError(owner + ".fuel_mg", now.point.fuel_mg, "must be > 0, a bench fires", "mg");
    }
  }
}

void validate_limits(const BenchSettings& s) {
  if (s.limits.size() > max_limits) {
    throw about("limits", ParameterError("limits has " + std::to_string(s.limits.size()) +
                                         " entries: must be at most " + std::to_string(max_limits)));
  }
  constexpr auto fields = engine::indicator_fields<double>();
  std::string known(cov_imep_name);
  for (const auto& field : fields)
    known.append(", ").append(field.name);
  for (const BenchLimit& limit : bench_limits)
    known.append(", ").append(limit.name);
  const auto measured = [&](const std::string& name) {
    return name == cov_imep_name ||
           std::any_of(bench_limits.begin(), bench_limits.end(),
                       [&](const BenchLimit& limit) { return limit.name == name; }) ||
           std::any_of(fields.begin(), fields.end(), [&](const auto& field) { return field.name == name; });
  };
  const auto stranger = std::find_if_not(s.limits.begin(), s.limits.end(), measured);
  if (stranger == s.limits.end()) return;
  ParameterError refusal("limits: '" + *stranger + "' is not measured: must be one of " + known);
  refusal.field = "limits";
  refusal.value = *stranger;
  refusal.bound = "one of " + known;
  throw refusal;
}

void require_input(bool holds, BenchInput input, const std::string& reason) {
  if (!holds) throw about("inputs", ParameterError("inputs: " + std::string(name_of(input)) + " " + reason));
}

void validate_inputs(const BenchSettings& s) {
  if (s.inputs.empty() || s.inputs[0] != BenchInput::soc_cad)
    throw about("inputs", ParameterError("inputs: must begin with soc_cad; the others stand behind it"));
  for (std::size_t i = 1; i < s.inputs.size(); ++i) {
    const BenchInput input = s.inputs[i];
    const auto before = s.inputs.begin() + static_cast<std::ptrdiff_t>(i);
    require_input(std::find(s.inputs.begin(), before, input) == before, input, "stands there twice: name it once");
    if (input == BenchInput::second_fraction) {
      require_input(s.cylinder.burn.burn_shape == engine::BurnShape::double_wiebe, input,
                    "needs burn_shape = 'double_wiebe': the cylinder has one burn law only");
    }
    if (input == BenchInput::intake_pressure_kpa) {
      const double least = window_of(input, s.cylinder)[0];
      require_input(least + s.cylinder.gas.ivc_pressure_rise_kpa > 0.0, input,
                    "reaches down to " + text(least) + " kPa, where ivc_pressure_rise_kpa = " +
                        text(s.cylinder.gas.ivc_pressure_rise_kpa) + " leaves no pressure at IVC: raise it");
    }
    if (input == BenchInput::egr) {
      for (const auto& [name, model] :
           {std::pair{"true_nox", &s.true_nox}, std::pair{"soft_sensor", &s.soft_sensor.model}}) {
        require_input(model->intake_o2_fraction == engine::air_o2_fraction, input,
                      "gives the intake oxygen itself: leave intake_o2_fraction of " + std::string(name) + " at 0.209");
      }
    }
  }
}

}  // namespace

std::array<double, 2> closed_part(const engine::Cylinder& c) noexcept {
  const double lead =
      c.burn.burn_shape == engine::BurnShape::double_wiebe ? std::fmin(0.0, c.burn.second_delay_cad) : 0.0;
  return {c.geometry.ivc_cad - lead, std::nextafter(c.geometry.evo_cad, c.geometry.ivc_cad)};
}

std::array<double, 2> timing_window(const engine::Cylinder& c) noexcept {
  const std::array<double, 2> closed = closed_part(c);
  return {std::fmax(engine::timing_lower_cad, closed[0]), std::fmin(engine::timing_upper_cad, closed[1])};
}

std::array<double, 2> window_of(BenchInput input, const engine::Cylinder& cylinder) noexcept {
  switch (input) {
    case BenchInput::intake_pressure_kpa:
      return {50.0, 500.0};
    case BenchInput::burn_duration_cad:
      return {5.0, 120.0};
    case BenchInput::second_fraction:
      return {0.0, 1.0};
    case BenchInput::egr:
      return {0.0, 0.5};
    case BenchInput::soc_cad:
      break;
  }
  return timing_window(cylinder);
}

void validate(const BenchSettings& s) {
  engine::validate(s.cylinder);
  static_cast<void>(engine::crank_grid(s.cylinder, s.step_cad));
  validate_schedule(s);
  require_fields(fields_of(s), s);
  check_member("true_nox", [&] { engine::validate(s.true_nox); });
  check_member("soft_sensor", [&] { engine::validate(s.soft_sensor); });
  validate("analyser", s.analyser);
  validate("fast_sensor", s.fast_sensor);
  if (s.nox_sensor == NoxSensor::none && !s.delay_whole_objective &&
      s.performance.uses(engine::PerformanceSignal::nox_ppm)) {
    throw about("nox_sensor",
                ParameterError("nox_sensor = 'none': the performance uses nox_ppm, name the sensor that measures it"));
  }
  validate_limits(s);
  validate_inputs(s);
}

}  // namespace mgdd::loop
