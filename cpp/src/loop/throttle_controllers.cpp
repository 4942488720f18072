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

}  // namespace

ThrottleMonteCarloResult monte_carlo(const ThrottleMonteCarlo& plan, const std::function<bool()>& stop) {
  check(plan);
  const std::size_t scenarios = plan.scenarios.size(), per_plant = plan.controllers.size() * scenarios;
  const std::size_t jobs = plan.plants.size() * per_plant;
  ThrottleMonteCarloResult result{std::vector<TrackingFigures>(jobs), {}};
  const auto run = [&](std::size_t job, std::size_t, StopRequest& stopped) {
    if (stopped()) return;
    const std::size_t s = job % scenarios;
    const ThrottleScenario& scenario = plan.scenarios[s];
    VirtualThrottleSettings plant = plan.plants[job / per_plant];
    plant.start_deg = std::clamp(scenario.reference_deg.front(), plant.throttle.closed_deg, plant.throttle.open_deg);
    ThrottleController controller = plan.controllers[job % per_plant / scenarios];
    const ThrottleTrack track =
        std::visit([&](auto& c) { return run_throttle_loop(c, plant, plan.delay_samples, scenario); }, controller);
    result.figures[job] = tracking_figures(scenario, track, plant.sample_s, plan.band_deg[s]);
  };
  result.finished = parallel_for(jobs, thread_count(jobs, static_cast<std::size_t>(plan.threads)), run, stop);
  return result;
}

}  // namespace mgdd::loop
