// A controller on the virtual throttle over a recorded reference: measured angle in, duty out, the duty behind a whole
// number of samples. What it did is a track; figures say how well. Angles in deg, duty -1..1, time in s.
// The samples themselves allocate nothing; runs are offline code.
#pragma once

#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/loop/virtual_throttle.hpp"
#include "mgdd/loop/virtual_throttle_lanes.hpp"

namespace mgdd::loop {

/// A controller of the plate's angle.
template <class C>
concept AngleController = std::copyable<C> && requires(C& controller, double deg) {
  { controller.step(deg, deg) } noexcept -> std::same_as<double>;
};

/// What a loop follows and what disturbs it, sample by sample.
struct ThrottleScenario {
  std::vector<double> reference_deg;
  std::vector<double> airflow_torque_nm;  ///< as many, or none for still air
  std::vector<double> supply_v;           ///< as many, or none for that of the throttle
  std::size_t from = 0;                   ///< sample at which figures begin; the step of a step reference
};
/// ParameterError or ShapeError naming the column.
void validate(const ThrottleScenario& scenario);

inline constexpr int longest_loop_delay = 20;

/// Columns of a run, one entry per sample: the angles are those at its end, the duty is that computed at its start.
struct ThrottleTrack {
  std::vector<double> angle_deg, sensed_angle_deg, speed_deg_per_s, current_a, duty;
};

/// How well a reference was followed, from sample `from` on. Errors are reference less true angle, the angle at the end
/// of the sample whose start the reference names.
struct TrackingFigures {
  double settling_ms = 0.0;       ///< whole samples until the error stays within the band; NaN: never
  double mse_deg2 = 0.0;          ///< over all samples
  double static_error_deg = 0.0;  ///< mean size over the last 0.1 s
  double overshoot_deg = 0.0;     ///< beyond the last reference, in the direction of the step; 0 without one
  double total_variation = 0.0;   ///< of the duty
  double limit_cycle_deg = 0.0;   ///< peak to peak over the last 0.3 s if the reference stands still there, else 0
  double largest_error_deg = 0.0;
};
/// `band_deg` of the settling.
TrackingFigures tracking_figures(const ThrottleScenario& scenario, const ThrottleTrack& track, double sample_s,
                                 double band_deg);

/// Time between the samples that a controller is made for; none where it does not say.
template <class C>
std::optional<double> sample_s_of(const C& controller) {
  if constexpr (requires { controller.settings().sample_s; }) {
    return controller.settings().sample_s;
  } else if constexpr (requires { controller.model().sample_s(); }) {
    return controller.model().sample_s();
  } else {
    return std::nullopt;
  }
}

/// What stands before a run, and what every sample of one does; shared by single runs and runs in lanes.
/// ParameterError for a bad delay or scenario, or a controller that is made for other samples than the plant's.
void require_loop(const ThrottleScenario& scenario, int delay_samples, std::optional<double> controller_s,
                  double plant_s);
ThrottleTrack empty_track(const ThrottleScenario& scenario);
/// Inputs of sample k, whose duty is computed already.
VirtualThrottleInputs inputs_at(const ThrottleScenario& scenario, const ThrottleTrack& track, std::size_t k,
                                std::size_t delay, double supply_v) noexcept;
void note(ThrottleTrack& track, std::size_t k, const VirtualThrottleSample& now) noexcept;

/// The run of a controller from rest at the start angle of the plant. ParameterError for a bad delay or scenario.
template <AngleController C>
ThrottleTrack run_throttle_loop(C& controller, const VirtualThrottleSettings& plant, int delay_samples,
                                const ThrottleScenario& scenario) {
  require_loop(scenario, delay_samples, sample_s_of(controller), plant.sample_s);
  VirtualThrottle throttle(plant);
  ThrottleTrack track = empty_track(scenario);
  const auto delay = static_cast<std::size_t>(delay_samples);
  double measured = plant.start_deg;
  for (std::size_t k = 0; k < scenario.reference_deg.size(); ++k) {
    track.duty[k] = controller.step(scenario.reference_deg[k], measured);
    const VirtualThrottleSample now = throttle.step(inputs_at(scenario, track, k, delay, plant.throttle.supply_v));
    measured = now.sensed.angle_deg;
    note(track, k, now);
  }
  return track;
}

/// As many runs as there are controllers, each on a plant of its own, with the bits of single runs: the plants in
/// lanes. ParameterError as there, and as for `VirtualThrottleLanes`.
template <AngleController C>
std::vector<ThrottleTrack> run_throttle_lanes(std::span<C> controllers, std::span<const VirtualThrottleSettings> plants,
                                              int delay_samples, const ThrottleScenario& scenario) {
  for (std::size_t lane = 0; lane < plants.size(); ++lane)
    require_loop(scenario, delay_samples, sample_s_of(controllers[lane]), plants[lane].sample_s);
  VirtualThrottleLanes throttles(plants);
  std::vector<ThrottleTrack> tracks(plants.size(), empty_track(scenario));
  std::vector<VirtualThrottleInputs> inputs(plants.size());
  std::vector<VirtualThrottleSample> now(plants.size());
  const auto delay = static_cast<std::size_t>(delay_samples);
  for (std::size_t lane = 0; lane < plants.size(); ++lane)
    now[lane].sensed.angle_deg = plants[lane].start_deg;
  for (std::size_t k = 0; k < scenario.reference_deg.size(); ++k) {
    for (std::size_t lane = 0; lane < plants.size(); ++lane) {
      tracks[lane].duty[k] = controllers[lane].step(scenario.reference_deg[k], now[lane].sensed.angle_deg);
      inputs[lane] = inputs_at(scenario, tracks[lane], k, delay, plants[lane].throttle.supply_v);
    }
    throttles.step(inputs, now);
    for (std::size_t lane = 0; lane < plants.size(); ++lane)
      note(tracks[lane], k, now[lane]);
  }
  return tracks;
}

}  // namespace mgdd::loop
