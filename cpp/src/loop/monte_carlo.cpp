#include "mgdd/loop/monte_carlo.hpp"

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "mgdd/common/parallel.hpp"
#include "mgdd/loop/virtual_engine_lanes.hpp"

namespace mgdd::loop {
namespace {

constexpr std::int64_t cycles_between_looks = 256;

template <class Plant>
void check(const MonteCarloPlanOf<Plant>& plan) {
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
  if (!plan.answers.empty() && plan.answers.size() != plan.benches.size() * plan.seekers.size()) {
    throw about("answers", ShapeError("answers has " + std::to_string(plan.answers.size()) +
                                      " entries: one per bench and seeker, or none"));
  }
  for (const Plant& bench : plan.benches) {
    for (const LoopSeeker& seeker : plan.seekers)
      std::visit([&](const auto& s) { require_match(bench, s); }, seeker);
  }
  for (const LoopSeeker& seeker : plan.seekers) {
    const auto* const guided = std::get_if<guide::GuidedEngine>(&seeker);
    if (guided != nullptr && guided->protocol().asked) {
      throw about("seekers", ParameterError("seekers: a GuidedEngine stands between ask() and tell(): tell what was "
                                            "measured first"));
    }
  }
}

template <class Plant>
std::size_t loops_per_bench(const MonteCarloPlanOf<Plant>& plan) noexcept {
  return plan.seekers.size() * plan.seeds.size();
}

/// One loop of the plan, at its start.
struct Loop {
  template <class Plant>
  Loop(const MonteCarloPlanOf<Plant>& plan, std::size_t number)
      : bench_index(number / loops_per_bench(plan)),
        seed(plan.seeds[number % plan.seeds.size()]),
        seeker(plan.seekers[number % loops_per_bench(plan) / plan.seeds.size()]),
        statistics(std::visit([&](const auto& s) { return with_limits_of(plan.criteria[bench_index], s); }, seeker),
                   plan.cycles) {
    std::span<const guide::GuideAnswer> said;
    if (!plan.answers.empty()) said = plan.answers[number / plan.seeds.size()];
    std::visit(
        [this, said](auto& s) {
          if constexpr (requires { s.reseed(seed); }) s.reseed(seed);
          if constexpr (requires { s.follow(said); }) s.follow(said);
        },
        seeker);
  }
  template <class Plant>
  Plant bench(const MonteCarloPlanOf<Plant>& plan) const {
    Plant out = plan.benches[bench_index];
    out.reset(seed);
    return out;
  }

  std::size_t bench_index;
  std::uint64_t seed;
  LoopSeeker seeker;
  LoopStatistics statistics;
};

template <class Plant>
void run_alone(const MonteCarloPlanOf<Plant>& plan, std::size_t number, StopRequest& stopped,
               std::vector<LoopSummary>& out) {
  Loop loop(plan, number);
  Plant bench = loop.bench(plan);
  constexpr std::int64_t looks =
      std::is_same_v<Plant, VirtualEngine> ? cycles_between_looks : 1;  // a function may be slow
  std::visit(
      [&](auto& seeker) {
        for (std::int64_t k = 0; k < plan.cycles; ++k) {
          if (k % looks == 0 && stopped()) return;
          loop.statistics.add(loop_step(bench, seeker));
        }
      },
      loop.seeker);
  if (!stopped.obeyed()) out[number] = loop.statistics.summary();
}

/// Loops that one thread takes at a time.
struct LoopRange {
  std::size_t first, last;
  bool lanes;
};

void run_side_by_side(const MonteCarloPlan& plan, const LoopRange& range, StopRequest& stopped,
                      std::vector<LoopSummary>& out) {
  std::vector<Loop> loops;
  std::vector<VirtualEngine> benches;
  for (std::size_t number = range.first; number < range.last; ++number) {
    loops.emplace_back(plan, number);
    benches.push_back(loops.back().bench(plan));
  }
  VirtualEngineLanes lanes(std::move(benches));
  std::vector<double> soc_cad(loops.size()), estimate_cad(loops.size());
  std::vector<BenchCycle> cycles(loops.size());
  constexpr auto looks = cycles_between_looks / static_cast<std::int64_t>(VirtualEngineLanes::width);
  for (std::int64_t k = 0; k < plan.cycles; ++k) {
    if (k % looks == 0 && stopped()) return;
    for (std::size_t i = 0; i < loops.size(); ++i) {
      soc_cad[i] =
          std::visit([&](auto& seeker) { return ask(lanes.bench(i), seeker, estimate_cad[i])[0]; }, loops[i].seeker);
    }
    lanes.step(soc_cad, cycles);
    for (std::size_t i = 0; i < loops.size(); ++i) {
      std::visit([&](auto& seeker) { tell(lanes.bench(i), cycles[i], seeker); }, loops[i].seeker);
      loops[i].statistics.add({cycles[i], estimate_cad[i]});
    }
  }
  for (std::size_t i = 0; i < loops.size(); ++i)
    out[range.first + i] = loops[i].statistics.summary();
}

/// Loops of like benches stand in a row; the threads share each row evenly.
std::vector<LoopRange> groups_of(const MonteCarloPlan& plan, LoopForm form) {
  const std::size_t each = loops_per_bench(plan), n = plan.benches.size() * each;
  const std::size_t threads = thread_count(n, static_cast<std::size_t>(plan.threads));
  std::vector<LoopRange> groups;
  for (std::size_t bench = 0; bench < plan.benches.size();) {
    const VirtualEngine& one = plan.benches[bench];
    std::size_t end = bench + 1;
    while (end < plan.benches.size() && side_by_side(plan.benches[end], one))
      ++end;
    const bool lanes = form == LoopForm::lanes && side_by_side(one, one);
    const std::size_t first = bench * each, count = (end - bench) * each;
    const std::size_t full = (count + VirtualEngineLanes::width - 1) / VirtualEngineLanes::width;
    const std::size_t parts = lanes ? std::min(count, (full + threads - 1) / threads * threads) : count;
    for (std::size_t part = 0; part < parts; ++part)
      groups.push_back({first + part * count / parts, first + (part + 1) * count / parts, lanes});
    bench = end;
  }
  return groups;
}

/// The groups of a plan on its threads; `run` does one of them.
template <class Plan, class Run>
MonteCarloResult run_groups(const Plan& plan, const std::vector<LoopRange>& groups, const std::function<bool()>& stop,
                            const Run& run) {
  const std::size_t loops = groups.back().last;
  MonteCarloResult result{std::vector<LoopSummary>(loops), std::vector<bool>(loops)};
  const std::vector<bool> finished = parallel_for(
      groups.size(), static_cast<std::size_t>(plan.threads),
      [&](std::size_t group, std::size_t, StopRequest& stopped) { run(groups[group], stopped, result.loops); }, stop);
  for (std::size_t group = 0; group < groups.size(); ++group) {
    for (std::size_t loop = groups[group].first; loop < groups[group].last; ++loop)
      result.finished[loop] = finished[group];
  }
  return result;
}

}  // namespace

LoopForm form_of_loops(std::size_t loops, LoopForm wanted) {
  if (wanted == LoopForm::shared) {
    throw ParameterError("form", name_of(wanted), "must be automatic, single or lanes");
  }
  if (wanted != LoopForm::automatic) return wanted;
  return loops >= VirtualEngineLanes::width ? LoopForm::lanes : LoopForm::single;
}

MonteCarloResult monte_carlo(const MonteCarloPlan& plan, const std::function<bool()>& stop) {
  check(plan);
  const std::size_t loops = plan.benches.size() * loops_per_bench(plan);
  return run_groups(plan, groups_of(plan, form_of_loops(loops, plan.form)), stop,
                    [&plan](const LoopRange& group, StopRequest& stopped, std::vector<LoopSummary>& out) {
                      group.lanes ? run_side_by_side(plan, group, stopped, out)
                                  : run_alone(plan, group.first, stopped, out);
                    });
}

MonteCarloResult monte_carlo(const MonteCarloPlanOf<FunctionPlant>& plan, const std::function<bool()>& stop) {
  check(plan);
  std::vector<LoopRange> groups;
  for (std::size_t loop = 0; loop < plan.benches.size() * loops_per_bench(plan); ++loop)
    groups.push_back({loop, loop + 1, false});
  return run_groups(plan, groups, stop,
                    [&plan](const LoopRange& group, StopRequest& stopped, std::vector<LoopSummary>& out) {
                      run_alone(plan, group.first, stopped, out);
                    });
}

}  // namespace mgdd::loop
