// A run of a recorded seeker: the same cycles as one by one, its history, and an end by request.
#include "mgdd/loop/run_loop.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <stop_token>
#include <thread>

namespace mgdd::loop {
namespace {

using Recorded = optimize::RecordedSeeker<optimize::ExtremumSeeking>;

Recorded seeker() {
  optimize::ExtremumSeekingSettings s;
  s.space = {optimize::scalar_input(-20.0), optimize::scalar_input(-30.0), optimize::scalar_input(10.0)};
  return Recorded(optimize::ExtremumSeeking(s));
}

// Inlined, GCC 12 takes the list behind the default schedule for uninitialized.
[[gnu::noinline]] BenchSettings bench_with_misfires() {
  BenchSettings s;
  s.misfire_probability = 0.1;
  s.seed = 3;
  return s;
}

TEST(RunLoop, IsItsCyclesOneByOne) {
  EngineBench bench(bench_with_misfires()), twin(bench_with_misfires());
  Recorded whole = seeker();
  optimize::ExtremumSeeking plain = whole.seeker();
  const LoopCriteria criteria{.optimum_cad = -5.6};
  const LoopRun run = run_loop(bench, whole, 120, criteria);
  EXPECT_FALSE(run.stopped);
  ASSERT_EQ(run.cycles.size(), 120u);
  const StateColumns history = whole.history().save();
  LoopStatistics statistics(criteria, 120);
  for (std::size_t k = 0; k < 120; ++k) {
    const LoopCycle one = loop_step(twin, plain);
    statistics.add(one);
    EXPECT_EQ(one.bench.soc_requested_cad, run.cycles[k].bench.soc_requested_cad);
    EXPECT_EQ(one.estimate_cad, run.cycles[k].estimate_cad);
    EXPECT_EQ(history.at("applied")[k], one.bench.soc_requested_cad);
    EXPECT_EQ(history.at("estimate")[k], one.estimate_cad);
    EXPECT_EQ(history.at("misfire")[k], one.bench.misfire ? 1.0 : 0.0);
    EXPECT_EQ(std::isnan(history.at("objective")[k]), one.bench.misfire);
    EXPECT_TRUE(one.bench.misfire || history.at("objective")[k] == one.bench.j);
  }
  EXPECT_EQ(run.summary.mean_j, statistics.summary().mean_j);
  EXPECT_EQ(run.summary.rms_cad, statistics.summary().rms_cad);
  EXPECT_EQ(save_state(whole.seeker()), save_state(plain));
  EXPECT_EQ(save_state(bench), save_state(twin));
}

TEST(RunLoop, ARequestEndsItBetweenTwoCycles) {
  EngineBench bench(bench_with_misfires());
  Recorded s = seeker();
  std::stop_source source;
  const std::jthread soon([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    source.request_stop();
  });
  const LoopRun run = run_loop(bench, s, 200'000, {}, source.get_token());
  EXPECT_TRUE(run.stopped);
  const auto done = static_cast<std::int64_t>(run.cycles.size());
  EXPECT_EQ(run.summary.cycles, done);
  EXPECT_EQ(bench.cycle(), done);
  EXPECT_EQ(s.seeker().protocol().cycle, done);
  EXPECT_EQ(s.history().size(), run.cycles.size());
}

TEST(RunLoop, ARefusedRunMovesNothing) {
  EngineBench bench(bench_with_misfires());
  Recorded s = seeker();
  EXPECT_THROW(run_loop(bench, s, 0, {}), ParameterError);
  EXPECT_THROW(run_loop(bench, s, 10, {.arrival_cad = -1.0}), ParameterError);
  EXPECT_EQ(bench.cycle(), 0);
  EXPECT_EQ(s.history().size(), 0u);
}

}  // namespace
}  // namespace mgdd::loop
