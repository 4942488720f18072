// The closed loop: what it promises to a controller, and what it makes of a run.
#include "mgdd/loop/engine_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/no_alloc.hpp"

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

}  // namespace
}  // namespace mgdd::loop
