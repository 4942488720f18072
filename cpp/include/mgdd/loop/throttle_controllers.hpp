// Every controller of the plate that a loop can run by name, and many loops at once: every throttle with every
// controller and every scenario, on all cores, healthy throttles of one form in SIMD lanes. A run depends on its own
// plant, controller and scenario only, so the result is the same in any lane and on any number of threads. Offline
// code.
#pragma once

#include <functional>
#include <variant>
#include <vector>

#include "mgdd/control/guided_predictive.hpp"
#include "mgdd/control/mgdd1.hpp"
#include "mgdd/control/pid.hpp"
#include "mgdd/control/sliding_mode.hpp"
#include "mgdd/loop/throttle_loop.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"

namespace mgdd::loop {

template <class M>
using Mgdd1On = control::Mgdd1<M, throttle::ObserverGains>;

using ThrottleController =
    std::variant<control::GuidedPredictive, control::Pid, control::SlidingMode, Mgdd1On<throttle::PwRModel>,
                 Mgdd1On<throttle::PwWModel>, Mgdd1On<throttle::PwPModel>>;

struct ThrottleMonteCarlo {
  std::vector<VirtualThrottleSettings> plants;  ///< each run starts at rest at its scenario's first reference
  std::vector<ThrottleController> controllers;  ///< each run gets a copy
  std::vector<ThrottleScenario> scenarios;
  int delay_samples = 1;
  std::vector<double> band_deg;  ///< of the settling, one per scenario
  int threads = 0;               ///< 0 = all cores
};

struct ThrottleMonteCarloResult {
  std::vector<TrackingFigures> figures;  ///< [plant][controller][scenario], the last index fastest
  std::vector<bool> finished;            ///< all true unless stopped
};

/// ParameterError for an empty plan. `stop` is polled by the calling thread about every 50 ms.
ThrottleMonteCarloResult monte_carlo(const ThrottleMonteCarlo& plan, const std::function<bool()>& stop);

}  // namespace mgdd::loop
