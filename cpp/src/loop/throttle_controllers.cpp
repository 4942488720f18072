#include "mgdd/loop/throttle_controllers.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "mgdd/common/parallel.hpp"

namespace mgdd::loop {
namespace {

void check(const ThrottleMonteCarlo& plan) {
  for (const auto& [name, empty] :
       {std::pair{"plants", plan.plants.empty()}, std::pair{"controllers", plan.controllers.empty()},
        std::pair{"scenarios", plan.scenarios.empty()}}) {
    if (empty) throw about(name, ParameterError(std::string(name) + " is empty: give at least one"));
  }
  if (plan.band_deg.size() != plan.scenarios.size()) {
    throw about("band_deg", ShapeError("band_deg has " + std::to_string(plan.band_deg.size()) +
                                       " entries: one per scenario, " + std::to_string(plan.scenarios.size())));
  }
  if (plan.threads < 0) throw ParameterError("threads", plan.threads, "must be >= 0 (0: all)");
  for (const VirtualThrottleSettings& plant : plan.plants)
    validate(plant);
  for (const ThrottleScenario& scenario : plan.scenarios)
    validate(scenario);
}

constexpr std::size_t fewest_lanes = 3;  // fewer are as fast one by one

/// Plants of consecutive numbers that run side by side.
struct Group {
  std::size_t first = 0, size = 0;
};

std::vector<Group> grouped(const std::vector<VirtualThrottleSettings>& plants) {
  std::vector<Group> groups;
  for (std::size_t i = 0; i < plants.size(); ++i) {
    const bool joins = !groups.empty() && groups.back().size < VirtualThrottleLanes::width &&
                       side_by_side(plants[groups.back().first], plants[i]);
    if (!joins) groups.push_back({i, 0});
    ++groups.back().size;
  }
  return groups;
}

VirtualThrottleSettings at_start(VirtualThrottleSettings plant, const ThrottleScenario& scenario) {
  plant.start_deg = std::clamp(scenario.reference_deg.front(), plant.throttle.closed_deg, plant.throttle.open_deg);
  return plant;
}

template <class C>
std::vector<ThrottleTrack> runs(const C& controller, std::span<const VirtualThrottleSettings> plants, int delay_samples,
                                const ThrottleScenario& scenario) {
  std::vector<C> copies(plants.size(), controller);
  if (plants.size() >= fewest_lanes) return run_throttle_lanes(std::span(copies), plants, delay_samples, scenario);
  std::vector<ThrottleTrack> tracks;
  for (std::size_t i = 0; i < plants.size(); ++i)
    tracks.push_back(run_throttle_loop(copies[i], plants[i], delay_samples, scenario));
  return tracks;
}

}  // namespace

ThrottleMonteCarloResult monte_carlo(const ThrottleMonteCarlo& plan, const std::function<bool()>& stop) {
  check(plan);
  const std::vector<Group> groups = grouped(plan.plants);
  const std::size_t scenarios = plan.scenarios.size(), per_plant = plan.controllers.size() * scenarios;
  const std::size_t jobs = groups.size() * per_plant;
  ThrottleMonteCarloResult result{std::vector<TrackingFigures>(plan.plants.size() * per_plant), {}};
  const auto run = [&](std::size_t job, std::size_t, StopRequest& stopped) {
    if (stopped()) return;
    const Group& group = groups[job / per_plant];
    const std::size_t s = job % scenarios;
    const ThrottleScenario& scenario = plan.scenarios[s];
    std::vector<VirtualThrottleSettings> plants;
    for (std::size_t i = 0; i < group.size; ++i)
      plants.push_back(at_start(plan.plants[group.first + i], scenario));
    const std::vector<ThrottleTrack> tracks =
        std::visit([&](const auto& c) { return runs(c, plants, plan.delay_samples, scenario); },
                   plan.controllers[job % per_plant / scenarios]);
    for (std::size_t i = 0; i < group.size; ++i) {
      result.figures[(group.first + i) * per_plant + job % per_plant] =
          tracking_figures(scenario, tracks[i], plants[i].sample_s, plan.band_deg[s]);
    }
  };
  const std::vector<bool> finished =
      parallel_for(jobs, thread_count(jobs, static_cast<std::size_t>(plan.threads)), run, stop);
  for (const Group& group : groups) {
    for (std::size_t i = 0; i < group.size * per_plant; ++i)
      result.finished.push_back(finished[static_cast<std::size_t>(&group - groups.data()) * per_plant + i % per_plant]);
  }
  return result;
}

}  // namespace mgdd::loop
