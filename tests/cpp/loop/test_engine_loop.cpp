// The closed loop: what it promises to a controller, and what it makes of a run.
#include "mgdd/loop/engine_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
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
  EngineBench bench(rich_bench());
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

TEST(EngineLoop, AMisfireAdvancesTheBenchAndNotTheSeeker) {
  BenchSettings settings;
  settings.misfire_probability = 1.0;
  EngineBench bench(settings);
  optimize::ExtremumSeeking seeker(batch(-12.0));
  const double first = seeker.ask()[0];
  for (int k = 0; k < 12; ++k)  // after these other inputs are tried
    EXPECT_DOUBLE_EQ(loop_step(bench, seeker).bench.soc_requested_cad, first);
  EXPECT_EQ(seeker.protocol().misfires, 12);
  EXPECT_EQ(bench.cycle(), 12);
  EXPECT_DOUBLE_EQ(seeker.estimate()[0], -12.0);
}

// The step to another load restarts the seeker: the estimate is held for one window.
TEST(EngineLoop, ANewOperatingPointHoldsTheEstimateForOnePeriod) {
  BenchSettings settings;
  settings.schedule = {{0, {}}, {153, {.fuel_mg = 30.0}}};
  EngineBench bench(settings);
  optimize::ExtremumSeeking seeker(batch(-20.0));
  std::vector<double> estimate;
  for (int k = 0; k < 200; ++k)
    estimate.push_back(loop_step(bench, seeker).estimate_cad);
  EXPECT_NE(estimate[140], estimate[152]);
  for (std::size_t k = 153; k < 163; ++k)
    EXPECT_DOUBLE_EQ(estimate[k], estimate[153]) << k;
  EXPECT_NE(estimate[163], estimate[153]);
}

TEST(EngineLoop, ASeekerThatDoesNotFitIsRefused) {
  const EngineBench bench(rich_bench());
  optimize::ExtremumSeekingSettings s = batch(-12.0);
  EXPECT_THROW(require_match(bench, optimize::ExtremumSeeking(s)), ParameterError);  // no limits
  s.limits = {{.name = "cov_imep_percent", .upper = 5.0}, {.name = "p_max_bar", .upper = 95.0}};
  EXPECT_THROW(require_match(bench, optimize::ExtremumSeeking(s)), ParameterError);  // other order
  std::swap(s.limits[0], s.limits[1]);
  EXPECT_NO_THROW(require_match(bench, optimize::ExtremumSeeking(s)));
  s.components.resize(3);
  EXPECT_THROW(require_match(bench, optimize::ExtremumSeeking(s)), ParameterError);
  s.components.resize(2);
  EXPECT_NO_THROW(require_match(bench, optimize::ExtremumSeeking(s)));
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
  LoopStatistics statistics({.optimum_cad = 0.0, .tail_cycles = 2, .exceed_from = 4, .exceed_above = {10.0}}, 8);
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
}

TEST(LoopStatistics, LimitsAreJudgedInShortRunsToo) {
  const LoopCriteria standard{.exceed_above = {10.0}};
  EXPECT_EQ(counted_from(standard, 1), 0);
  EXPECT_EQ(counted_from(standard, 1000), 500);
  EXPECT_EQ(counted_from(standard, 1999), 999);
  EXPECT_EQ(counted_from(standard, 2000), 1000);
  EXPECT_EQ(counted_from(standard, 50000), 1000);
  EXPECT_EQ(counted_from({.exceed_from = 7}, 50000), 7);
  for (const int cycles : {1, 2, 7, 1000}) {
    LoopStatistics statistics(standard, cycles);
    for (int k = 0; k < cycles; ++k)
      statistics.add(cycle_at(5.0, k < cycles / 2 ? 99.0 : k % 2 == 0 ? 11.0 : 9.0));
    const int counted = cycles - cycles / 2;
    const int even = (cycles + 1) / 2 - (cycles / 2 + 1) / 2;
    EXPECT_DOUBLE_EQ(statistics.summary().exceeded_fraction, static_cast<double>(even) / counted) << cycles;
  }
}

TEST(LoopStatistics, LimitsAreToldFromTheFirstCycleOnAndWithoutAMargin) {
  LoopStatistics statistics({.exceed_from = 4, .limits = {10.0}}, 9);
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (const double value : {11.0, 99.0, 10.0, 10.1, 10.0, 10.1, none, 99.0, 9.0})
    statistics.add(cycle_at(0.0, value));
  const LoopSummary s = statistics.summary();
  EXPECT_EQ(s.judged_from, 4);
  const LimitFigures& f = s.limits[0];
  EXPECT_DOUBLE_EQ(f.limit, 10.0);
  EXPECT_DOUBLE_EQ(f.worst, 99.0);
  EXPECT_DOUBLE_EQ(f.worst_cycle, 1.0);
  EXPECT_EQ(f.read_cycles, 8);
  EXPECT_EQ(f.above_cycles, 5);
  EXPECT_EQ(f.judged_read_cycles, 4);
  EXPECT_EQ(f.judged_above_cycles, 2);
  EXPECT_TRUE(std::isnan(s.limits[1].worst));  // the bench has one limit
  EXPECT_TRUE(std::isnan(s.exceeded_fraction));
  EXPECT_THROW(validate({.limits = {none}}, 9), ParameterError);
}

TEST(LoopStatistics, TheLimitsAreThoseOfTheSeekerUnlessNamed) {
  optimize::ExtremumSeekingSettings s = batch(-12.0);
  s.limits = {{.name = "p_max_bar", .upper = 110.0, .margin = 3.0}, {.name = "cov_imep_percent", .upper = 5.0}};
  const optimize::ExtremumSeeking seeker(s);
  EXPECT_EQ(with_limits_of({}, seeker).limits, (std::vector{110.0, 5.0}));
  EXPECT_EQ(with_limits_of({.limits = {90.0, 4.0}}, seeker).limits, (std::vector{90.0, 4.0}));
}

TEST(LoopStatistics, AWindowWithoutACycleIsRefused) {
  EXPECT_NO_THROW(validate({.exceed_from = 299, .exceed_above = {10.0}}, 300));
  EXPECT_NO_THROW(validate({.exceed_from = 1000}, 300));  // no threshold: nothing is judged
  try {
    validate({.exceed_from = 300, .exceed_above = {10.0}}, 300);
    FAIL();
  } catch (const ParameterError& error) {
    EXPECT_STREQ(error.what(), "exceed_from = 300: must be < cycles = 300, or no cycle counts");
    EXPECT_EQ(error.field, "exceed_from");
  }
  EXPECT_THROW(validate({.exceed_from = -1}, 300), ParameterError);
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
