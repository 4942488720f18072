// Curves, and seeking by them.
#include "mgdd/guide/curve.hpp"
#include "mgdd/guide/curve_seeking.hpp"
#include "support/no_alloc.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

using optimize::Inputs;
using optimize::scalar_input;
using optimize::TellStatus;

/// Of the engine: J'' -0.05, a little flatter above.
double engine_like(double x) {
  return 56.0 - 0.05 * (std::exp(-0.02 * x) - 1.0 + 0.02 * x) / 0.0004;
}

CurveSeekingSettings guided(double best, double start) {
  CurveSeekingSettings s;
  s.space = {scalar_input(start), scalar_input(-30.0), scalar_input(10.0)};
  s.curve = Curve::parabola(-0.05, best, 60.0);
  return s;
}

/// Estimates before each cycle, on a plant with its best input at `at(cycle)`.
std::vector<double> seek(CurveSeeking& seeker, int cycles, const std::function<double(int)>& at, double noise_sd,
                         std::uint64_t seed = 1) {
  std::vector<double> path{seeker.estimate()[0]};
  for (int k = 0; k < cycles; ++k) {
    const double noise = noise_sd * random::normal(seed, 3, static_cast<std::uint64_t>(k));
    const double j[] = {engine_like(seeker.ask()[0] - at(k)) + noise};
    EXPECT_EQ(seeker.tell({j, {}, false}), TellStatus::accepted);
    path.push_back(seeker.estimate()[0]);
  }
  return path;
}

TEST(CurveSeeking, ArrivesWithinFiveCyclesWhereverTheGuideStands) {
  for (const double best : {-20.0, -12.0, -5.0, 3.0, 8.0}) {
    for (const double start : {best, -20.0, 5.0}) {
      CurveSeeking seeker(guided(best, start));
      const std::vector<double> path = seek(seeker, 200, [](int) { return -6.0; }, 0.0);
      for (std::size_t k = 6; k < path.size(); ++k)
        ASSERT_NEAR(path[k], -6.0, 0.6) << "guide " << best << " start " << start << " cycle " << k;
      EXPECT_NEAR(path.back(), -6.0, 0.35) << "guide " << best << " start " << start;
      EXPECT_FALSE(seeker.handed_over()) << "without noise the guide is kept";
    }
  }
}

TEST(CurveSeeking, StaysUnderNoiseThatNobodyTold) {
  double late = 0.0, inside = 0.0;
  const int seeds = 60, cycles = 300;
  int lost = 0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    CurveSeeking seeker(guided(3.0, 3.0));
    std::vector<double> path = seek(seeker, cycles, [](int) { return -6.0; }, 0.25, seed);
    lost += std::abs(path[40] + 6.0) > 2.5;
    for (double& x : path)
      x += 6.0;
    late += optimize::rms_of(path, cycles / 2, cycles) / seeds;
    inside += std::abs(path.back()) <= 1.96 * seeker.estimate_sd() ? 1.0 / seeds : 0.0;
    EXPECT_NEAR(seeker.noise_sd(), 0.25, 0.08);
    EXPECT_GT(seeker.trust(), 0.5);
  }
  EXPECT_LE(late, 0.55);
  EXPECT_LE(lost, 2);
  EXPECT_GE(inside, 0.88);
}

TEST(CurveSeeking, ComesBackAfterAJump) {
  std::vector<double> back;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    CurveSeeking seeker(guided(-4.0, -4.0));
    const std::vector<double> path = seek(seeker, 260, [](int k) { return k < 200 ? -9.0 : -3.0; }, 0.25, seed);
    double cycles = 60.0;
    for (int k = 60; k > 0; --k) {
      if (std::abs(path[200 + static_cast<std::size_t>(k)] + 3.0) > 2.0) break;
      cycles = k;
    }
    back.push_back(cycles);
    EXPECT_FALSE(seeker.handed_over()) << "the guide is not to blame for a jump, seed " << seed;
  }
  std::nth_element(back.begin(), back.begin() + 20, back.end());
  EXPECT_LE(back[20], 8.0);
}

TEST(CurveSeeking, OneCycleAfterTheFirstReadingBehindASlowSensor) {
  constexpr int seeds = 5;
  for (const double believed : {34.0, 38.0, 42.0}) {
    double late = 0.0;
    for (std::uint64_t seed = 9; seed < 9 + seeds; ++seed) {
      CurveSeekingSettings settings = guided(-4.0, -20.0);
      settings.sensor = {believed, 25.0};
      CurveSeeking seeker(settings);
      const double share = -std::expm1(-1.0 / 25.0);
      std::vector<double> sent;
      double level = engine_like(-20.0 + 6.0), farthest = 0.0;
      std::size_t first = 0;
      for (std::size_t k = 0; k < 400; ++k) {
        sent.push_back(engine_like(seeker.ask()[0] + 6.0));
        level += share * (sent[k < 38 ? 0 : k - 38] - level);
        const double j[] = {level + 0.25 * random::normal(seed, 1, k)};
        ASSERT_EQ(seeker.tell({j, {}, false}), TellStatus::accepted);
        const double off = std::abs(seeker.estimate()[0] + 6.0);
        if (first == 0 && off < 3.0) first = k + 1;
        ASSERT_TRUE(first == 0 || off < 5.0) << believed << " cycle " << k;
        if (k >= 200) farthest = std::max(farthest, off);
      }
      EXPECT_LE(first, static_cast<std::size_t>(believed) + 2);
      EXPECT_EQ(seeker.doubts(), 0) << believed;
      late += farthest / seeds;
    }
    EXPECT_LT(late, 1.6) << believed;
  }
}

TEST(CurveSeeking, ACurveThatIsNoneIsRefusedAndThePointCountsAsNew) {
  CurveSeeking seeker(guided(-4.0, -4.0));
  seek(seeker, 50, [](int) { return -9.0; }, 0.0);
  const double before = seeker.estimate()[0], sd = seeker.estimate_sd();
  const std::vector<double> x{-45.0, -20.0, 20.0}, valley{5.0, 0.0, 9.0};
  EXPECT_FALSE(seeker.guide(Curve(x, valley)));
  EXPECT_FALSE(seeker.guide(Curve::parabola(-0.05, 40.0, 60.0)));
  EXPECT_EQ(seeker.estimate()[0], before);
  EXPECT_GT(seeker.estimate_sd(), sd);
  seek(seeker, 60, [](int) { return -12.0; }, 0.0);
  EXPECT_NEAR(seeker.estimate()[0], -12.0, 0.5);
}

TEST(CurveSeeking, HandsOverWhereTheGuideIsNothingLikeThePlant) {
  const auto spike = [](double x) { return -2.0 * std::abs(std::tanh(3.0 * x)) - 0.3 * std::abs(x); };
  CurveSeekingSettings settings = guided(8.0, 0.0);
  CurveSeeking seeker(settings);
  double reach = 0.0;
  for (int k = 0; k < 900; ++k) {
    const double j[] = {spike(seeker.ask()[0] + 6.0) + 0.05 * random::normal(4, 1, static_cast<std::uint64_t>(k))};
    ASSERT_EQ(seeker.tell({j, {}, false}), TellStatus::accepted);
    if (k > 700) reach = std::max(reach, std::abs(seeker.estimate()[0] + 6.0));
  }
  EXPECT_TRUE(seeker.handed_over());
  EXPECT_EQ(seeker.trust(), 0.0);
  EXPECT_LT(reach, 1.5);
  settings.hand_over = false;
  CurveSeeking stubborn(settings);
  for (int k = 0; k < 900; ++k)
    optimize::cycle_of(stubborn, [&](const Inputs& x) { return spike(x[0] + 6.0); });
  EXPECT_FALSE(stubborn.handed_over());
}

TEST(CurveSeeking, TrustSaysHowSteepTheGuideIsBesideThePlant) {
  for (const double steepness : {0.6, 1.0, 1.6}) {
    CurveSeekingSettings settings = guided(3.0, -20.0);
    settings.curve = Curve::parabola(-0.05 * steepness, 3.0, 60.0);
    CurveSeeking seeker(settings);
    seek(seeker, 150, [](int) { return -6.0; }, 0.1);
    EXPECT_NEAR(seeker.trust(), std::min(steepness, 1.0 / steepness), 0.15) << steepness;
    EXPECT_FALSE(seeker.handed_over());
  }
}

TEST(CurveSeeking, TakesNoMemoryAndNeverThrows) {
  for (const double delay : {0.0, 5.0}) {
    CurveSeekingSettings settings = guided(3.0, 3.0);
    settings.sensor = {delay, delay};
    CurveSeeking seeker(settings);
    static_assert(noexcept(seeker.ask()) && noexcept(seeker.tell({})) && noexcept(seeker.restart()));
    static_assert(noexcept(seeker.guide(settings.curve)));
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 300; ++k) {
      const double x = seeker.ask()[0];
      const double j[] = {(k < 150 ? engine_like(x + 6.0) : engine_like(x - 2.0)) +
                          0.2 * random::normal(2, 1, static_cast<std::uint64_t>(k))};
      seeker.tell({j, {}, k % 31 == 5});
      if (k == 100) seeker.guide(settings.curve);
      if (k == 200) seeker.restart();
    }
    EXPECT_EQ(counter.count(), 0U);
  }
}

double hill(double x) {
  return 3.0 - 0.04 * (x - 2.5) * (x - 2.5);
}

std::vector<double> of(double (*f)(double), const std::vector<double>& inputs) {
  std::vector<double> out;
  for (const double x : inputs)
    out.push_back(f(x));
  return out;
}

const std::vector<double> uneven{-11.0, -7.0, -6.5, -1.0, 0.0, 4.0, 9.0, 17.0};

TEST(Curve, ReproducesAParabolaFromUnevenPoints) {
  const Curve curve(uneven, of(hill, uneven));
  for (double x = -11.0; x <= 17.0; x += 0.37)
    EXPECT_NEAR(curve(x), hill(x), 4e-5) << x;  // the table is linear between its nodes
  EXPECT_NEAR(curve.best(), 2.5, 1e-6);
  EXPECT_NEAR(curve.top(), 3.0, 2e-5);
  EXPECT_NEAR(curve.curvature(3.0), -0.08, 1e-4);
  EXPECT_TRUE(curve.has_maximum());
  EXPECT_DOUBLE_EQ(curve.lower(), -11.0);
  EXPECT_NEAR(curve.upper(), 17.0, 1e-12);
}

TEST(Curve, PassesThroughItsPointsAndNeverFarBetweenThem) {
  const auto kinked = [](double x) { return x < 1.0 ? 0.2 * x : 0.2 - 1.5 * (x - 1.0); };
  const std::vector<double> inputs{-9.0, -4.0, 1.0, 6.0, 11.0, 30.0};
  std::vector<double> values;
  for (const double x : inputs)
    values.push_back(kinked(x));
  const Curve curve(inputs, values);
  for (std::size_t i = 0; i < inputs.size(); ++i)
    EXPECT_NEAR(curve(inputs[i]), values[i], 0.06) << i;
}

TEST(Curve, GoesOnStraightBeyondItsEnds) {
  const Curve curve(uneven, of(hill, uneven));
  const double slope = -0.08 * (17.0 - 2.5);
  EXPECT_NEAR(curve(27.0), hill(17.0) + 10.0 * slope, 0.03);
  EXPECT_NEAR(curve(-21.0) - curve(-16.0), curve(-16.0) - curve(-11.0), 1e-9);
}

TEST(Curve, AMaximumAtAnEndIsNone) {
  const std::vector<double> inputs{0.0, 1.0, 2.0, 4.0};
  EXPECT_FALSE(Curve(inputs, std::vector{0.0, 1.0, 2.0, 4.0}).has_maximum());
  EXPECT_DOUBLE_EQ(Curve(inputs, std::vector{4.0, 1.0, 0.0, -1.0}).best(), 0.0);
}

TEST(Curve, RisesAgainByAsMuchAsItsOtherMaximumStandsOut) {
  const std::vector<double> x{0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  EXPECT_LT(Curve(x, std::vector{1.0, 4.0, 6.0, 5.0, 3.0, 2.0, 0.0}).rises_again(9.0), 0.01);
  EXPECT_NEAR(Curve(x, std::vector{1.0, 4.0, 10.0, 5.0, 0.0, 6.0, 2.0}).rises_again(9.0), 0.6, 0.05);
  EXPECT_NEAR(Curve(x, std::vector{2.0, 6.0, 0.0, 5.0, 10.0, 4.0, 1.0}).rises_again(9.0), 0.6, 0.05);
  EXPECT_EQ(Curve(x, std::vector{2.0, 6.0, 0.0, 5.0, 10.0, 4.0, 1.0}).rises_again(1.9), 0.0);
}

TEST(Curve, OtherPointsCostNoAllocation) {
  Curve curve;
  const std::vector<double> values = of(hill, uneven);
  const test_support::AllocationCounter counter;
  EXPECT_TRUE(curve.put(uneven, values));
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_EQ(curve, Curve(uneven, values));
  static_assert(noexcept(curve.put(uneven, values)) && noexcept(curve(1.0)));
}

}  // namespace
}  // namespace mgdd::guide
