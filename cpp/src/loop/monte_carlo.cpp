#include "mgdd/loop/monte_carlo.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

namespace mgdd::loop {
namespace {

constexpr std::int64_t cycles_between_looks = 256;

void check(const MonteCarloPlan& plan) {
  for (const auto& [name, empty] :
       {std::pair{"benches", plan.benches.empty()}, std::pair{"seekers", plan.seekers.empty()},
        std::pair{"seeds", plan.seeds.empty()}}) {
    if (empty) throw ParameterError(std::string(name) + " is empty: give at least one");
  }
  if (plan.criteria.size() != plan.benches.size()) {
    throw ShapeError("criteria has " + std::to_string(plan.criteria.size()) + " entries: one per bench, " +
                     std::to_string(plan.benches.size()));
  }
  if (plan.cycles < 1) throw ParameterError("cycles = " + std::to_string(plan.cycles) + ": must be >= 1");
  if (plan.threads < 0) throw ParameterError("threads = " + std::to_string(plan.threads) + ": must be >= 0 (0: all)");
  for (const EngineBench& bench : plan.benches) {
    for (const optimize::Seeker& seeker : plan.seekers)
      std::visit([&](const auto& s) { require_match(bench, s); }, seeker);
  }
}

}  // namespace

MonteCarloResult monte_carlo(const MonteCarloPlan& plan, const std::function<bool()>& stop) {
  check(plan);
  const std::size_t seeds = plan.seeds.size();
  const std::size_t per_bench = plan.seekers.size() * seeds;
  const std::size_t jobs = plan.benches.size() * per_bench;
  std::vector<LoopSummary> loops(jobs);
  std::vector<std::uint8_t> finished(jobs, 0);  // bytes: threads write neighbours
  std::atomic<std::size_t> next{0};
  std::atomic<bool> stopped{false};
  std::mutex mutex;
  std::condition_variable idle;
  std::size_t working = 0;

  const auto work = [&] {
    std::vector<EngineBench> benches = plan.benches;  // each thread its own: a bench carries its workspace
    for (std::size_t job = next++; job < jobs && !stopped; job = next++) {
      EngineBench& bench = benches[job / per_bench];
      const std::uint64_t seed = plan.seeds[job % seeds];
      optimize::Seeker seeker = plan.seekers[job % per_bench / seeds];
      bench.reset(seed);
      LoopStatistics statistics(plan.criteria[job / per_bench], plan.cycles);
      std::visit(
          [&](auto& s) {
            if constexpr (requires { s.reseed(seed); }) s.reseed(seed);
            for (std::int64_t k = 0; k < plan.cycles; ++k) {
              if (k % cycles_between_looks == 0 && stopped) return;
              statistics.add(loop_step(bench, s));
            }
          },
          seeker);
      if (stopped) break;
      loops[job] = statistics.summary();
      finished[job] = 1;
    }
    const std::lock_guard lock(mutex);
    --working;
    idle.notify_all();
  };

  const auto cores = static_cast<std::size_t>(std::max(1u, std::thread::hardware_concurrency()));
  const std::size_t threads = std::min(jobs, plan.threads > 0 ? static_cast<std::size_t>(plan.threads) : cores);
  working = threads;
  std::vector<std::jthread> pool;
  for (std::size_t t = 0; t < threads; ++t)
    pool.emplace_back(work);
  {
    std::unique_lock lock(mutex);
    while (!idle.wait_for(lock, std::chrono::milliseconds(50), [&] { return working == 0; })) {
      lock.unlock();
      if (stop && stop()) stopped = true;
      lock.lock();
    }
  }
  pool.clear();
  return {std::move(loops), std::vector<bool>(finished.begin(), finished.end())};
}

}  // namespace mgdd::loop
