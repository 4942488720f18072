// Measured limits of a curve-guided seeker: allowed inputs by the guide's curves, or by lines that are learnt.
#include "mgdd/guide/limit_curves.hpp"

#include "mgdd/guide/curve_seeking.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

using optimize::Limit;
using optimize::LimitState;
using optimize::scalar_input;

/// Peak pressure of a plant, falling with later timing, and the guide's: too high by a twentieth, too flat by a fifth.
double peak_bar(double x) {
  return 84.0 - 3.6 * x + 0.03 * x * x;
}
Curve guides_peak() {
  std::vector<double> inputs, values;
  for (double x = -45.0; x <= 20.0; x += 1.0) {
    inputs.push_back(x);
    values.push_back(88.0 + 0.8 * (peak_bar(x) - 84.0));
  }
  return {inputs, values};
}

LimitCurves with_curve(double upper, optimize::ComponentLag lag = {}) {
  Limit limit{"p_max_bar", upper};
  limit.lag = lag;
  limit.margin_sd = 0.0;
  return {{limit}, {guides_peak()}, -30.0, 10.0, 4.0, 140.0};
}

TEST(LimitCurves, TheGuidesCurveCountsBeforeAnyReading) {
  LimitCurves limits = with_curve(100.0);
  EXPECT_GT(limits.excess(-20.0), 0.0);
  EXPECT_LT(limits.excess(10.0), 0.0);
  EXPECT_GT(limits.nearest(-20.0), -3.0) << "a guide that may lie off by a tenth of the limit is not trusted further";
}

TEST(LimitCurves, ReadingsMoveTheEdgeToThePlantsOwn) {
  LimitCurves limits = with_curve(100.0);
  for (int k = 0; k < 60; ++k) {
    const double x = limits.nearest(-20.0) + (k % 2 == 0 ? 0.0 : 1.5);
    const double value[] = {peak_bar(x)};
    limits.record(x, value);
  }
  const double edge = limits.nearest(-20.0);
  EXPECT_NEAR(peak_bar(edge), 100.0, 0.8);
  EXPECT_LE(peak_bar(edge), 100.0);
  EXPECT_EQ(limits.state(0), LimitState::active);
  EXPECT_EQ(limits.nearest(5.0), 5.0);
  EXPECT_EQ(limits.state(0), LimitState::free);
}

TEST(LimitCurves, WithoutACurveOnlyWhatWasTriedIsAllowed) {
  const Limit limit{"p_max_bar", 100.0};
  LimitCurves limits({limit}, {}, -30.0, 10.0, 4.0, 140.0);
  const double value[] = {peak_bar(5.0)};
  EXPECT_EQ(limits.nearest(-20.0), -20.0) << "nothing was applied yet";
  limits.record(5.0, value);
  EXPECT_GT(limits.nearest(-20.0), 1.0);
  for (int k = 0; k < 60; ++k) {
    const double x = limits.nearest(-20.0) + (k % 2 == 0 ? 0.0 : 1.0);
    const double now[] = {peak_bar(x) + 0.3 * random::normal(3, 1, static_cast<std::uint64_t>(k))};
    limits.record(x, now);
    EXPECT_LE(peak_bar(x), 101.0);
  }
  EXPECT_NEAR(peak_bar(limits.nearest(-20.0)), 99.0, 1.5);
}

TEST(LimitCurves, ALateReadingIsJudgedOnTheInputThatCausedIt) {
  LimitCurves limits = with_curve(100.0, {10.0, 0.0});
  std::vector<double> sent;
  for (std::size_t k = 0; k < 200; ++k) {
    sent.push_back(limits.nearest(k % 20 < 10 ? -20.0 : 3.0));
    EXPECT_LE(peak_bar(sent.back()), 100.0) << k;
    const double value[] = {peak_bar(sent[k < 10 ? 0 : k - 10])};
    limits.record(sent.back(), value);
  }
  EXPECT_NEAR(peak_bar(limits.nearest(-20.0)), 100.0, 1.0);
}

TEST(LimitCurves, ContradictoryLimitsEndInTheLeastViolation) {
  Limit low{"p_max_bar", 80.0}, high{"late", 0.0};
  low.margin_sd = high.margin_sd = 0.0;
  low.scale = high.scale = 10.0;
  LimitCurves limits({low, high}, {}, -30.0, 10.0, 4.0, 140.0);
  for (int k = 0; k < 80; ++k) {
    const double x = -5.0 + (k % 5) * 2.0;
    const double values[] = {90.0 - 2.0 * x, 6.0 + 2.0 * x};  // equal excess at x = 1: 8 and 8
    limits.record(x, values);
  }
  EXPECT_NEAR(limits.nearest(-20.0), 1.0, 0.4);
  EXPECT_EQ(limits.state(0), LimitState::infeasible);
  EXPECT_EQ(limits.state(1), LimitState::infeasible);
}

// --- in the seeker --------------------------------------------------------------------------------------------

CurveSeekingSettings limited(bool drawn, optimize::ComponentLag lag = {}) {
  CurveSeekingSettings s;
  s.space = {scalar_input(5.0), scalar_input(-30.0), scalar_input(10.0)};
  s.curve = Curve::parabola(-0.05, 0.0, 60.0);
  Limit limit{"p_max_bar", 95.0};
  limit.lag = lag;
  limit.margin_sd = 1.0;
  s.limits = {limit};
  if (drawn) s.limit_curves = {guides_peak()};
  return s;
}

/// What a seeker applies in every cycle on a J best at -8, read with noise; the limit comes late.
std::vector<double> applied_of(CurveSeeking& seeker, int cycles, double delay, double limit_sd, std::uint64_t seed) {
  std::vector<double> applied;
  for (int k = 0; k < cycles; ++k) {
    const auto at = static_cast<std::uint64_t>(k);
    const double x = seeker.ask()[0];
    applied.push_back(x);
    const double late = applied[static_cast<std::size_t>(std::max(0.0, k - delay))];
    const double j[] = {-0.025 * (x + 8.0) * (x + 8.0) + 0.25 * random::normal(seed, 2, at)};
    const double limit[] = {peak_bar(late) + limit_sd * random::normal(seed, 1, at)};
    EXPECT_EQ(seeker.tell({j, limit, false}), optimize::TellStatus::accepted);
  }
  return applied;
}

class LimitedSeeking : public testing::TestWithParam<std::tuple<bool, double>> {};

TEST_P(LimitedSeeking, KeepsTheLimitAndEndsAtIt) {
  const auto [drawn, delay] = GetParam();
  std::ptrdiff_t above = 0;
  double end = 0.0;
  int active = 0;
  const int seeds = 20, cycles = 300;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    CurveSeeking seeker(limited(drawn, {delay, 0.0}));
    above += std::ranges::count_if(applied_of(seeker, cycles, delay, 1.2, seed),
                                   [](double x) { return peak_bar(x) > 95.0; });
    end += peak_bar(seeker.estimate()[0]) / seeds;
    active += seeker.limit_state(0) == LimitState::active;
  }
  EXPECT_GE(active, seeds - 2);
  EXPECT_LE(static_cast<double>(above), 0.01 * seeds * cycles);
  EXPECT_NEAR(end, 94.0, 1.5);
}

// The place beyond the limit stays unknown for ever; looking for it costs J.
TEST_P(LimitedSeeking, DithersAtTheLimitNoMoreThanItMust) {
  const auto [drawn, delay] = GetParam();
  CurveSeeking seeker(limited(drawn, {delay, 0.0}));
  const std::vector<double> applied = applied_of(seeker, 400, delay, 0.3, 21);
  for (std::size_t k = 200; k < applied.size(); ++k)
    EXPECT_NEAR(applied[k], seeker.estimate()[0], 2.3) << k;
}

TEST_P(LimitedSeeking, LeavesAStartAboveTheLimit) {
  const auto [drawn, delay] = GetParam();
  CurveSeekingSettings settings = limited(drawn, {delay, 0.0});
  for (const double start : {-22.0, -9.0}) {
    settings.space.start = scalar_input(start);
    CurveSeeking seeker(settings);
    const std::vector<double> applied = applied_of(seeker, 200, delay, 0.5, 22);
    EXPECT_LE(std::count_if(applied.begin() + 60, applied.end(), [](double x) { return peak_bar(x) > 95.0; }), 3);
    EXPECT_NEAR(peak_bar(seeker.estimate()[0]), 93.5, 2.0) << "start " << start;
  }
}

TEST(LimitCurves, ABetterGuideMovesNothingOverTheLimit) {
  CurveSeeking seeker(limited(true));
  for (int k = 0; k < 100; ++k) {
    const double x = seeker.ask()[0], j[] = {-0.025 * (x + 8.0) * (x + 8.0)}, limit[] = {peak_bar(x)};
    seeker.tell({j, limit, false});
  }
  ASSERT_TRUE(seeker.believe(Curve::parabola(-0.05, -9.0, 60.0), 1.0));
  EXPECT_LE(peak_bar(seeker.estimate()[0]), 95.0);
}

INSTANTIATE_TEST_SUITE_P(DrawnOrNot, LimitedSeeking, testing::Combine(testing::Bool(), testing::Values(0.0, 10.0)));

TEST(LimitCurves, TakeNoMemoryInTheLoop) {
  for (const bool drawn : {false, true}) {
    CurveSeeking seeker(limited(drawn, {3.0, 0.0}));
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 100; ++k) {
      const double x = seeker.ask()[0], j[] = {-0.025 * (x + 8.0) * (x + 8.0)}, limit[] = {peak_bar(x)};
      seeker.tell({j, limit, false});
    }
    EXPECT_EQ(counter.count(), 0U);
  }
}

}  // namespace
}  // namespace mgdd::guide
