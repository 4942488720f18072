#include "mgdd/loop/monte_carlo.hpp"

#include <string>
#include <utility>
#include <variant>

#include "mgdd/common/parallel.hpp"

namespace mgdd::loop {
namespace {

constexpr std::int64_t cycles_between_looks = 256;

void check(const MonteCarloPlan& plan) {
  for (const auto& [name, empty] :
       {std::pair{"benches", plan.benches.empty()}, std::pair{"seekers", plan.seekers.empty()},
        std::pair{"seeds", plan.seeds.empty()}}) {
    if (empty) throw about(name, ParameterError(std::string(name) + " is empty: give at least one"));
  }
  if (plan.criteria.size() != plan.benches.size()) {
    throw about("criteria", ShapeError("criteria has " + std::to_string(plan.criteria.size()) +
                                       " entries: one per bench, " + std::to_string(plan.benches.size())));
  }
  if (plan.cycles < 1) throw ParameterError("cycles", plan.cycles, "must be >= 1");
  if (plan.threads < 0) throw ParameterError("threads", plan.threads, "must be >= 0 (0: all)");
  for (const LoopCriteria& criteria : plan.criteria)
    validate(criteria, plan.cycles);
  for (const EngineBench& bench : plan.benches) {
    for (const Seeker& seeker : plan.seekers)
      std::visit([&](const auto& s) { require_match(bench, s); }, seeker);
  }
}

}  // namespace

MonteCarloResult monte_carlo(const MonteCarloPlan& plan, const std::function<bool()>& stop) {
  check(plan);
  const std::size_t seeds = plan.seeds.size();
  const std::size_t per_bench = plan.seekers.size() * seeds;
  const std::size_t jobs = plan.benches.size() * per_bench;
  const std::size_t threads = thread_count(jobs, static_cast<std::size_t>(plan.threads));
  MonteCarloResult result{std::vector<LoopSummary>(jobs), {}};
  std::vector<std::vector<EngineBench>> benches(threads, plan.benches);  // a bench carries its workspace
  const auto run = [&](std::size_t job, std::size_t worker, StopRequest& stopped) {
    EngineBench& bench = benches[worker][job / per_bench];
    const std::uint64_t seed = plan.seeds[job % seeds];
    Seeker seeker = plan.seekers[job % per_bench / seeds];
    bench.reset(seed);
    std::visit(
        [&](auto& s) {
          LoopStatistics statistics(with_limits_of(plan.criteria[job / per_bench], s), plan.cycles);
          if constexpr (requires { s.reseed(seed); }) s.reseed(seed);
          for (std::int64_t k = 0; k < plan.cycles; ++k) {
            if (k % cycles_between_looks == 0 && stopped()) return;
            statistics.add(loop_step(bench, s));
          }
          if (!stopped.obeyed()) result.loops[job] = statistics.summary();
        },
        seeker);
  };
  result.finished = parallel_for(jobs, threads, run, stop);
  return result;
}

}  // namespace mgdd::loop
