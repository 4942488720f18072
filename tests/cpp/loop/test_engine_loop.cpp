// Loops around a bench: figures by their definitions, no allocation, functions as plants, many at once.
#include <cstring>
#include <stdexcept>

#include "mgdd/loop/cycle_fields.hpp"
#include "mgdd/loop/engine_loop.hpp"
#include "mgdd/loop/function_plant.hpp"
#include "mgdd/loop/monte_carlo.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

using optimize::scalar_input;

optimize::SearchSpace engine_space(double start_cad) {
  return {scalar_input(start_cad), scalar_input(-30.0), scalar_input(10.0)};
}

optimize::ExtremumSeekingSettings batch(double start_cad) {
  optimize::ExtremumSeekingSettings s;
  s.space = engine_space(start_cad);
  return s;
}

BenchSettings rich_bench() {
  BenchSettings s;
  s.performance = engine::efficiency_and_nox();
  s.nox_sensor = NoxSensor::analyser;
  s.limits = {"p_max_bar", "cov_imep_percent"};
  s.misfire_probability = 0.02;
  s.schedule = {{0, {}}, {150, {.speed_rpm = 1800.0, .fuel_mg = 28.0}}};
  s.seed = 7;
  return s;
}

TEST(EngineLoop, AStepAllocatesNothing) {
  VirtualEngine bench(rich_bench());
  optimize::ExtremumSeekingSettings s = batch(-12.0);
  s.limits = {{.name = "p_max_bar", .upper = 110.0}, {.name = "cov_imep_percent", .upper = 50.0}};
  s.components = {{}, {38.0, 25.0}};
  optimize::ExtremumSeeking seeker(s);
  static_assert(noexcept(loop_step(bench, seeker)));
  LoopStatistics statistics({.optimum_cad = -5.6, .exceed_from = 10, .exceed_above = {100.0, 40.0}}, 300);
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 300; ++k)
    statistics.add(loop_step(bench, seeker));
  EXPECT_EQ(counter.count(), 0u);
}

LoopCycle cycle_at(double estimate_cad, double limit_value = 0.0, bool misfire = false) {
  LoopCycle c;
  c.estimate_cad = estimate_cad;
  c.bench.soc_requested_cad = estimate_cad;
  c.bench.misfire = misfire;
  c.bench.j = misfire ? -100.0 : estimate_cad;
  c.bench.limit_count = 1;
  c.bench.limit_values[0] = limit_value;
  return c;
}

TEST(LoopStatistics, CountsAsItsDefinitionsSay) {
  LoopStatistics statistics(
      {.optimum_cad = 0.0, .tail_cycles = 2, .exceed_from = 4, .exceed_above = {10.0}, .limits = {10.0}}, 8);
  const std::vector<double> estimates{4.0, 1.0, 2.0, 1.0, 0.5, -0.5, 0.5, 0.1};
  const std::vector<double> values{99.0, 99.0, 99.0, 99.0, 10.0, 10.1, 9.0, 11.0};
  for (std::size_t k = 0; k < estimates.size(); ++k)
    statistics.add(cycle_at(estimates[k], values[k], k == 5));
  const LoopSummary s = statistics.summary();
  EXPECT_DOUBLE_EQ(s.cycles_to, 1.0);
  EXPECT_DOUBLE_EQ(s.cycles_stays, 3.0);
  EXPECT_DOUBLE_EQ(s.final_cad, 0.3);
  EXPECT_DOUBLE_EQ(s.mean_cad, 0.15);
  EXPECT_DOUBLE_EQ(s.rms_cad, std::sqrt((3 * 0.25 + 0.01) / 4.0));
  EXPECT_DOUBLE_EQ(s.exceeded_fraction, 0.5);  // above, not at: cycles 5 and 7 of 4..7
  EXPECT_NEAR(s.mean_j, (0.5 + 0.5 + 0.1) / 3.0, 1e-15);
  EXPECT_EQ(s.misfires, 1);
  EXPECT_DOUBLE_EQ(s.lowest_cad, -0.5);
  EXPECT_DOUBLE_EQ(s.highest_cad, 4.0);
  EXPECT_EQ(s.limits[0].worst_cycle, 0.0);
  EXPECT_EQ(s.limits[0].above_cycles, 6);  // at the limit is not above it
  EXPECT_EQ(s.limits[0].judged_above_cycles, 2);
  EXPECT_EQ(s.limits[0].judged_read_cycles, 4);
}

TEST(LoopStatistics, SaysNothingOfWhatWasNotAskedOrDidNotHappen) {
  LoopStatistics statistics({}, 4);
  for (int k = 0; k < 4; ++k)
    statistics.add(cycle_at(5.0));
  EXPECT_TRUE(std::isnan(statistics.summary().rms_cad));
  EXPECT_TRUE(std::isnan(statistics.summary().cycles_to));
  EXPECT_TRUE(std::isnan(statistics.summary().exceeded_fraction));
  LoopStatistics away({.optimum_cad = 0.0}, 4);
  for (int k = 0; k < 4; ++k)
    away.add(cycle_at(5.0));
  EXPECT_TRUE(std::isnan(away.summary().cycles_to));
  EXPECT_TRUE(std::isnan(away.summary().cycles_stays));
  EXPECT_DOUBLE_EQ(away.summary().rms_cad, 5.0);
}

int hill(const double* inputs, std::size_t, double* outputs, std::size_t, void*) {
  outputs[0] = 50.0 - 0.03 * (inputs[0] + 4.0) * (inputs[0] + 4.0);
  return inputs[0] > 5.0 ? 3 : 0;
}

TEST(FunctionPlant, AStepAllocatesNothing) {
  FunctionPlant plant(&hill, nullptr, {.noise_sd = 0.5});
  optimize::SpsaSettings s;
  s.space = {optimize::scalar_input(-12.0), optimize::scalar_input(-30.0), optimize::scalar_input(10.0)};
  optimize::Spsa seeker(s);
  static_assert(noexcept(loop_step(plant, seeker)));
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 100; ++k)
    loop_step(plant, seeker);
  EXPECT_EQ(counter.count(), 0u);
}

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
