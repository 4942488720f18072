// Many loops at once are the same loops, on any number of threads.
#include "mgdd/loop/monte_carlo.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "mgdd/loop/cycle_fields.hpp"

namespace mgdd::loop {
namespace {

using optimize::scalar_input;

MonteCarloPlan small_plan() {
  MonteCarloPlan plan;
  BenchSettings bench;
  bench.limits = {"p_max_bar"};
  plan.benches.emplace_back(bench);
  bench.schedule[0].point.fuel_mg = 30.0;
  bench.misfire_probability = 0.01;
  plan.benches.emplace_back(bench);
  plan.criteria = {{.optimum_cad = -5.6, .exceed_from = 100, .exceed_above = {95.0}}, {.optimum_cad = -9.0}};
  const optimize::SearchSpace space{scalar_input(-12.0), scalar_input(-30.0), scalar_input(10.0)};
  const std::vector<optimize::Limit> limits{{.name = "p_max_bar", .upper = 150.0}};
  optimize::ExtremumSeekingSettings esc;
  esc.space = space;
  esc.limits = limits;
  optimize::SpsaSettings spsa;
  spsa.space = space;
  spsa.limits = limits;
  plan.seekers = {optimize::ExtremumSeeking(esc), optimize::Spsa(spsa)};
  plan.seeds = {3, 1, 4};
  plan.cycles = 300;
  return plan;
}

bool same(const LoopSummary& a, const LoopSummary& b) {  // bit for bit, NaN included
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): eight bytes each, no padding
  return std::memcmp(&a, &b, sizeof(LoopSummary)) == 0;
}

MonteCarloPlan wide_plan() {  // three operating points, the last with a gamma of temperature
  MonteCarloPlan plan = small_plan();
  BenchSettings bench = plan.benches[1].settings();
  bench.cylinder.gas.gamma_model = engine::GammaModel::linear;
  plan.benches.emplace_back(bench);
  plan.criteria.push_back({.optimum_cad = -7.0});
  plan.seeds = {3, 1, 4, 8, 5};
  return plan;
}

TEST(MonteCarlo, LanesAreTheSameOnAnyNumberOfThreadsAndInAnyPieces) {
  MonteCarloPlan plan = wide_plan();
  EXPECT_EQ(form_of_loops(30, plan.form), LoopForm::lanes);
  plan.threads = 1;
  const MonteCarloResult one = monte_carlo(plan, {});
  plan.threads = 3;
  const MonteCarloResult three = monte_carlo(plan, {});
  ASSERT_EQ(one.loops.size(), 30u);
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_TRUE(one.finished[i]);
    EXPECT_TRUE(same(one.loops[i], three.loops[i])) << i;
  }
  MonteCarloPlan piece = plan;  // bench 1, seeker 1, seeds 8 and 5
  piece.benches = {plan.benches[1]};
  piece.criteria = {plan.criteria[1]};
  piece.seekers = {plan.seekers[1]};
  piece.seeds = {8, 5};
  piece.form = LoopForm::lanes;
  const MonteCarloResult part = monte_carlo(piece, {});
  EXPECT_TRUE(same(part.loops[0], one.loops[18]));
  EXPECT_TRUE(same(part.loops[1], one.loops[19]));
}

TEST(MonteCarlo, LanesGiveTheNumbersOfSingleLoops) {
  MonteCarloPlan plan = wide_plan();
  const MonteCarloResult lanes = monte_carlo(plan, {});
  plan.form = LoopForm::single;
  const MonteCarloResult single = monte_carlo(plan, {});
  int differing = 0;
  for (std::size_t i = 0; i < 30; ++i) {
    for (const auto& number : loop_summary_numbers) {
      const double a = number.of(lanes.loops[i]), b = number.of(single.loops[i]);
      EXPECT_EQ(std::isnan(a), std::isnan(b)) << number.name << ' ' << i;
      const double distance = std::isnan(b) || a == b ? 0.0 : std::abs(a - b);
      EXPECT_LE(distance, 1e-7 * std::max(1.0, std::abs(b))) << number.name << ' ' << i;
    }
    EXPECT_NEAR(lanes.loops[i].limits[0].worst, single.loops[i].limits[0].worst, 1e-6) << i;
    differing += same(lanes.loops[i], single.loops[i]) ? 0 : 1;
    if (i >= 20) {  // a gamma of temperature has no lanes
      EXPECT_TRUE(same(lanes.loops[i], single.loops[i])) << i;
    }
  }
  EXPECT_GT(differing, 0);  // other roundings: lanes did run
}

TEST(MonteCarlo, AFewLoopsHaveTheBitsOfSingleOnes) {
  EXPECT_EQ(form_of_loops(15, LoopForm::automatic), LoopForm::single);
  EXPECT_EQ(form_of_loops(15, LoopForm::lanes), LoopForm::lanes);
  EXPECT_EQ(form_of_loops(16, LoopForm::automatic), LoopForm::lanes);
  EXPECT_THROW(static_cast<void>(form_of_loops(16, LoopForm::shared)), ParameterError);
}

TEST(MonteCarlo, AnExceptionOfTheStopCallbackEndsTheLoops) {
  MonteCarloPlan plan = small_plan();
  plan.cycles = 1'000'000'000;  // would take hours
  EXPECT_THROW(monte_carlo(plan, []() -> bool { throw std::runtime_error("signal"); }), std::runtime_error);
}

}  // namespace
}  // namespace mgdd::loop
