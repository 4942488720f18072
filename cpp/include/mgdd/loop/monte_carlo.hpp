// Many whole closed loops at once: every bench with every seeker and every seed, on all cores. A loop depends on its
// own bench, seeker and seed only, so the result is the same on any number of threads. Loops of like benches run side
// by side, their cycles in SIMD lanes. Offline code.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "mgdd/engine/batch/batch.hpp"
#include "mgdd/guide/guided_engine.hpp"
#include "mgdd/guide/scheduled_feed_forward.hpp"
#include "mgdd/loop/engine_loop.hpp"

namespace mgdd::loop {

/// How the loops run; never depends on the threads. `single` gives the bits of a loop that runs alone, `lanes` its
/// numbers to rounding; `automatic` takes lanes for sixteen loops and more. Gamma of temperature is always `single`.
using LoopForm = engine::BatchForm;

/// Every seeker that runs in many loops, those with a guide among them.
using LoopSeeker = WithKinds<Seeker, guide::GuidedEngine, guide::ScheduledFeedForward>;

template <class Plant>
struct MonteCarloPlanOf {
  std::vector<Plant> benches;
  std::vector<LoopCriteria> criteria;  ///< one per bench
  std::vector<LoopSeeker> seekers;
  std::vector<std::vector<guide::GuideAnswer>> answers{};  ///< [bench][seeker] for feed-forwards; empty: no guide
  std::vector<std::uint64_t> seeds;  ///< of the bench and of a seeker that draws; each loop starts at cycle 0
  std::int64_t cycles = 1000;
  int threads = 0;                      ///< 0 = all cores
  LoopForm form = LoopForm::automatic;  ///< of functions always `single`
};
using MonteCarloPlan = MonteCarloPlanOf<VirtualEngine>;

struct MonteCarloResult {
  std::vector<LoopSummary> loops;  ///< [bench][seeker][seed], the last index fastest
  std::vector<bool> finished;      ///< all true unless stopped
};

/// The form that this many loops take. Who cuts a plan into pieces asks before and passes it on; ParameterError for
/// `shared`, which no loop has.
LoopForm form_of_loops(std::size_t loops, LoopForm wanted);

/// ParameterError for an empty plan or a seeker that does not fit a bench. `stop` is polled by the calling thread about
/// every 50 ms; loops that are running then are dropped, finished ones stay.
MonteCarloResult monte_carlo(const MonteCarloPlan& plan, const std::function<bool()>& stop);
MonteCarloResult monte_carlo(const MonteCarloPlanOf<FunctionPlant>& plan, const std::function<bool()>& stop);

}  // namespace mgdd::loop
