#include "mgdd/loop/throttle_loop.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "mgdd/common/text.hpp"

namespace mgdd::loop {
namespace {

constexpr double static_s = 0.1, still_s = 0.3;

void require_column(std::string_view name, const std::vector<double>& column, std::size_t n) {
  if (column.empty()) return;
  if (column.size() != n) {
    throw about(name, ShapeError(std::string(name) + " has " + std::to_string(column.size()) +
                                 " samples: must have as many as reference_deg, " + std::to_string(n)));
  }
  for (const double value : column) {
    if (!std::isfinite(value)) throw ParameterError(name, value, "must be finite");
  }
}

std::size_t samples_of(double time_s, double sample_s, std::size_t n) {
  const auto samples = static_cast<std::size_t>(std::max(1.0, std::round(time_s / sample_s)));
  return std::min(samples, n);
}

}  // namespace

void validate(const ThrottleScenario& s) {
  const std::size_t n = s.reference_deg.size();
  if (n == 0) throw about("reference_deg", ShapeError("reference_deg is empty: give one angle per sample"));
  require_column("reference_deg", s.reference_deg, n);
  require_column("airflow_torque_nm", s.airflow_torque_nm, n);
  require_column("supply_v", s.supply_v, n);
  if (s.from >= n) {
    throw ParameterError("from", static_cast<double>(s.from), "must be < " + std::to_string(n) + ", the samples");
  }
}

void require_loop(const ThrottleScenario& scenario, int delay_samples, std::optional<double> controller_s,
                  double plant_s) {
  validate(scenario);
  if (delay_samples < 0 || delay_samples > longest_loop_delay) {
    throw ParameterError("delay_samples", delay_samples, "must be in [0, " + std::to_string(longest_loop_delay) + "]");
  }
  if (controller_s && !(std::abs(*controller_s - plant_s) < 1e-9)) {
    throw ParameterError("sample_s", *controller_s,
                         "of the controller, must be " + text(plant_s) + " s, the samples of the reference", "s");
  }
}

ThrottleTrack empty_track(const ThrottleScenario& scenario) {
  ThrottleTrack track;
  for (auto* column :
       {&track.angle_deg, &track.sensed_angle_deg, &track.speed_deg_per_s, &track.current_a, &track.duty})
    column->resize(scenario.reference_deg.size());
  return track;
}

VirtualThrottleInputs inputs_at(const ThrottleScenario& scenario, const ThrottleTrack& track, std::size_t k,
                                std::size_t delay, double supply_v) noexcept {
  return {k < delay ? 0.0 : track.duty[k - delay], scenario.supply_v.empty() ? supply_v : scenario.supply_v[k],
          scenario.airflow_torque_nm.empty() ? 0.0 : scenario.airflow_torque_nm[k]};
}

void note(ThrottleTrack& track, std::size_t k, const VirtualThrottleSample& now) noexcept {
  track.angle_deg[k] = now.angle_deg;
  track.sensed_angle_deg[k] = now.sensed.angle_deg;
  track.speed_deg_per_s[k] = now.speed_deg_per_s;
  track.current_a[k] = now.current_a;
}

TrackingFigures tracking_figures(const ThrottleScenario& s, const ThrottleTrack& track, double sample_s,
                                 double band_deg) {
  const std::size_t n = s.reference_deg.size(), counted = n - s.from;
  const auto error = [&](std::size_t k) { return s.reference_deg[k] - track.angle_deg[k]; };
  const double target = s.reference_deg[n - 1];
  const double step = s.from == 0 ? 0.0 : target - s.reference_deg[s.from - 1];
  TrackingFigures out;
  std::size_t last_outside = s.from;  // one behind the last sample outside the band
  for (std::size_t k = s.from; k < n; ++k) {
    out.mse_deg2 += error(k) * error(k) / static_cast<double>(counted);
    out.largest_error_deg = std::max(out.largest_error_deg, std::abs(error(k)));
    if (!(std::abs(error(k)) <= band_deg)) last_outside = k + 1;
    if (step != 0.0) {
      out.overshoot_deg = std::max(out.overshoot_deg, std::copysign(1.0, step) * (track.angle_deg[k] - target));
    }
    if (k > 0) out.total_variation += std::abs(track.duty[k] - track.duty[k - 1]);
  }
  const double sample_ms = 1e3 * sample_s;  // first, so that 1 kHz gives whole numbers
  out.settling_ms = last_outside == n ? std::numeric_limits<double>::quiet_NaN()
                                      : static_cast<double>(last_outside - s.from) * sample_ms;
  const std::size_t end = samples_of(static_s, sample_s, counted);
  for (std::size_t k = n - end; k < n; ++k)
    out.static_error_deg += std::abs(error(k)) / static_cast<double>(end);
  const std::size_t still = samples_of(still_s, sample_s, counted);
  const auto stands = [&](double r) { return r == target; };
  if (std::all_of(s.reference_deg.end() - static_cast<std::ptrdiff_t>(still), s.reference_deg.end(), stands)) {
    const auto [low, high] =
        std::minmax_element(track.angle_deg.end() - static_cast<std::ptrdiff_t>(still), track.angle_deg.end());
    out.limit_cycle_deg = *high - *low;
  }
  return out;
}

}  // namespace mgdd::loop
