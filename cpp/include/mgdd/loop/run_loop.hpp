// A whole run of a recorded seeker on the bench: its cycles, its summary, and an end before its end. Offline code:
// room for all cycles is made first, the cycles themselves allocate nothing.
#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/loop/engine_loop.hpp"
#include "mgdd/optimize/ask_tell/seeker_history.hpp"

namespace mgdd::loop {

struct LoopRun {
  std::vector<LoopCycle> cycles;
  LoopSummary summary;   ///< of these cycles, as if no more had been asked for
  bool stopped = false;  ///< before all cycles were run; bench, seeker and its history stand behind the last one
};

/// ParameterError for fewer than one cycle or a seeker that does not fit; nothing has moved then.
template <optimize::AnySeeker S>
LoopRun run_loop(VirtualEngine& bench, optimize::RecordedSeeker<S>& seeker, std::int64_t cycles,
                 const LoopCriteria& criteria, const std::stop_token& stop = {}) {
  if (cycles < 1) throw ParameterError("cycles", cycles, "must be >= 1");
  validate(criteria, cycles);
  require_match(bench, seeker.seeker());
  LoopRun run;
  run.cycles.reserve(static_cast<std::size_t>(cycles));
  seeker.history().make_room(static_cast<std::size_t>(cycles));
  for (std::int64_t k = 0; k < cycles && !stop.stop_requested(); ++k)
    run.cycles.push_back(loop_step(bench, seeker));
  const auto done = static_cast<std::int64_t>(run.cycles.size());
  LoopStatistics statistics(with_limits_of(criteria, seeker.seeker()), done);
  for (const LoopCycle& cycle : run.cycles)
    statistics.add(cycle);
  run.summary = statistics.summary();
  run.stopped = done < cycles;
  return run;
}

/// The same on a function, whose cycles stand in the history of the seeker: how many were run.
template <optimize::AnySeeker S>
std::int64_t run_loop(FunctionPlant& plant, optimize::RecordedSeeker<S>& seeker, std::int64_t cycles,
                      const std::stop_token& stop = {}) {
  if (cycles < 1) throw ParameterError("cycles", cycles, "must be >= 1");
  require_match(plant, seeker.seeker());
  seeker.history().make_room(static_cast<std::size_t>(cycles));
  std::int64_t done = 0;
  for (; done < cycles && !stop.stop_requested(); ++done)
    loop_step(plant, seeker);
  return done;
}

}  // namespace mgdd::loop
