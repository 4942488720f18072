// Seekers with a guide in many loops: the loop that one would write by hand.
#include <gtest/gtest.h>

#include <cstring>
#include <utility>
#include <vector>

#include "mgdd/loop/monte_carlo.hpp"
#include "support/guided_engine_case.hpp"

namespace mgdd::loop {
namespace {

using guide::GuideAnswer;
using guide::GuideCause;
using guide::GuidedEngine;
using guide::GuideValue;
using guide::ScheduledFeedForward;
using optimize::scalar_input;

constexpr std::int64_t step_at = 60, moved_at = 95;

engine::OperatingPoint point_of(double fuel_mg) {
  engine::OperatingPoint point;
  point.fuel_mg = fuel_mg;
  return point;
}

MonteCarloPlan plan_of(LoopSeeker seeker) {
  BenchSettings bench;
  bench.schedule = {{0, point_of(12.0)}, {step_at, point_of(30.0)}, {moved_at, point_of(31.0)}};
  bench.misfire_probability = 0.02;
  bench.pressure.noise_bar = 0.1;
  MonteCarloPlan plan;
  plan.benches.emplace_back(bench);
  plan.criteria = {{.optimum_cad = -5.6}};
  plan.seekers.push_back(std::move(seeker));
  plan.seeds = {7, 2, 9};
  plan.cycles = 130;
  plan.threads = 2;
  return plan;
}

guide::FeedForward<optimize::VariantSeeker> drawing() {
  optimize::SpsaSettings s;
  s.space = {scalar_input(-15.0), scalar_input(-30.0), scalar_input(10.0)};
  return guide::FeedForward(optimize::VariantSeeker(optimize::Spsa(s)));
}

GuideValue optimum(double cad) {
  return {scalar_input(cad)};
}

/// What the guide says before a cycle: a value, nothing at a new point, and a refusal that is repeated.
void say(std::int64_t cycle, guide::FeedForward<optimize::VariantSeeker>& seeker) {
  if (cycle == 0) seeker.offer(optimum(-4.0), GuideCause::new_point);
  if (cycle == step_at) seeker.hold();
  if (cycle == moved_at) seeker.offer(optimum(99.0), GuideCause::new_point);
  if (cycle > moved_at && cycle < 120) seeker.offer(optimum(99.0), GuideCause::following);
}

std::vector<GuideAnswer> said() {
  return {{0, 1, optimum(-4.0), GuideCause::new_point},
          {step_at, step_at + 1, {}, GuideCause::new_point},
          {moved_at, moved_at + 1, optimum(99.0), GuideCause::new_point},
          {moved_at + 1, 120, optimum(99.0), GuideCause::following}};
}

bool same(const LoopSummary& a, const LoopSummary& b) {  // bit for bit, NaN included
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): eight bytes each, no padding
  return std::memcmp(&a, &b, sizeof(LoopSummary)) == 0;
}

/// One loop by hand, of seed 2; `before` is what the seeker hears before a cycle, `after` is its tell.
template <class S, class Before, class Tell>
LoopSummary by_hand(const MonteCarloPlan& plan, S seeker, const Before& before, const Tell& after) {
  EngineBench bench = plan.benches[0];
  bench.reset(2);
  seeker.reseed(2);
  LoopStatistics statistics(plan.criteria[0], plan.cycles);
  for (std::int64_t k = 0; k < plan.cycles; ++k) {
    before(bench, seeker);
    const double estimate_cad = seeker.estimate()[0];
    const double asked = seeker.ask()[0];
    const BenchCycle c = bench.step({&asked, 1});
    after(bench, seeker, {{&c.j, 1}, {}, c.misfire || c.unphysical, {&c.soc_applied_cad, 1}});
    statistics.add({c, estimate_cad});
  }
  return statistics.summary();
}

TEST(GuidedLoops, AFeedForwardHearsWhatItsGuideSaid) {
  MonteCarloPlan plan = plan_of(ScheduledFeedForward(drawing()));
  plan.answers = {said()};
  const MonteCarloResult loops = monte_carlo(plan, {});
  const LoopSummary alone = by_hand(
      plan, drawing(), [](const EngineBench& bench, auto& s) { say(bench.cycle(), s); },
      [](EngineBench&, auto& s, const optimize::Reading& r) { s.tell(r); });
  EXPECT_TRUE(same(loops.loops[1], alone));
  EXPECT_GT(alone.misfires, 0);
  plan.answers.clear();
  EXPECT_FALSE(same(monte_carlo(plan, {}).loops[1], alone));  // the guide mattered
}

TEST(GuidedLoops, ARepeatedRefusalLowersTheTrustInEveryCycle) {
  ScheduledFeedForward scheduled(drawing());
  auto told = drawing();
  const std::vector<GuideAnswer> answers = said();
  scheduled.follow(answers);
  std::vector<double> trust;
  for (std::int64_t k = 0; k < 130; ++k) {
    scheduled.at_cycle(k);
    say(k, told);
    EXPECT_EQ(scheduled.path().trust().value(), told.path().trust().value()) << k;
    trust.push_back(told.path().trust().value());
  }
  EXPECT_LT(trust[110], trust[100]);
  EXPECT_EQ(trust[119], trust[129]);
}

TEST(GuidedLoops, AGuidedEngineHearsPointAndPressure) {
  const auto tell_with_pressure = [](EngineBench& bench, GuidedEngine& s, const optimize::Reading& r) {
    s.tell(r, bench.pressure().pressure_bar);
  };
  const auto tell_alone = [](EngineBench&, GuidedEngine& s, const optimize::Reading& r) { s.tell(r); };
  const auto at = [](const EngineBench& bench, GuidedEngine& s) { s.at(bench.point()); };
  const GuidedEngine guided(drawing(), guide::rough_model(), guide::calibration(), point_of(12.0));
  static_assert(noexcept(loop_step(std::declval<EngineBench&>(), std::declval<GuidedEngine&>())));
  MonteCarloPlan plan = plan_of(guided);
  const MonteCarloResult loops = monte_carlo(plan, {});
  const LoopSummary alone = by_hand(plan, guided, at, tell_with_pressure);
  EXPECT_TRUE(same(loops.loops[1], alone));
  EXPECT_FALSE(same(by_hand(plan, guided, at, tell_alone), alone));  // the pressure mattered
  plan.form = LoopForm::lanes;
  EXPECT_NEAR(monte_carlo(plan, {}).loops[1].mean_cad, alone.mean_cad, 1e-6);
}

TEST(GuidedLoops, WhatDoesNotFitIsRefused) {
  MonteCarloPlan plan = plan_of(ScheduledFeedForward(drawing()));
  plan.answers = {said(), said()};
  EXPECT_THROW(monte_carlo(plan, {}), ShapeError);
  GuidedEngine asked(drawing(), guide::rough_model(), std::nullopt, point_of(12.0));
  asked.ask();
  EXPECT_THROW(monte_carlo(plan_of(asked), {}), ParameterError);
}

}  // namespace
}  // namespace mgdd::loop
