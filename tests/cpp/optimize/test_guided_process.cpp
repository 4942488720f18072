// A rough model as the mean of a Gaussian process: its table, and what it is worth to the seeker.
#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

using Model = std::function<double(double, double)>;  // of timing and EGR

Surface table(const Model& model, double from = -25.0, double to = 15.0) {
  std::vector<std::vector<double>> axes(2);
  std::vector<double> values;
  for (int i = 0; i < 17; ++i)
    axes[0].push_back(from + (to - from) * i / 16.0);
  for (int k = 0; k < 13; ++k)
    axes[1].push_back(0.4 * k / 12.0);
  for (const double soc : axes[0]) {
    for (const double egr : axes[1])
      values.push_back(model(soc, egr));
  }
  return {axes, values};
}

GaussianProcessSeekingSettings settings_of(std::uint64_t seed, const Model& guide) {
  GaussianProcessSeekingSettings s;
  s.space.inputs = {{.name = "soc_cad", .lower = -25.0, .upper = 15.0}, {.name = "egr", .lower = 0.0, .upper = 0.4}};
  s.space.start = Inputs(2);
  s.space.start << 4.0, 0.31;
  s.seed = seed;
  if (guide) s.guide = {table(guide)};
  return s;
}

double lost(const Inputs& x) {
  const double a = x[0] + 4.0, b = 100.0 * (x[1] - 0.2);
  return 0.03 * (a * a + b * b + 1.2 * a * b);
}

// Off by a fifth of each range, in a level and a unit of its own, and too steep.
double off_by_a_fifth(double soc, double egr) {
  const double a = soc + 12.0, b = 100.0 * (egr - 0.28);
  return 900.0 - 0.04 * (a * a + b * b + b * a);
}

struct Outcome {
  double arrived, lost;
};
Outcome run(const GaussianProcessSeekingSettings& s, int cycles = 60) {
  GaussianProcessSeeking seeker(s);
  Outcome out{static_cast<double>(cycles), 0.0};
  for (int k = 0; k < cycles; ++k) {
    if (out.arrived == cycles && lost(seeker.estimate()) < 0.06) out.arrived = k;
    const double own = lost(seeker.ask());
    out.lost += own;
    const double j[] = {(s.maximize ? 1.0 : -1.0) *
                        (50.0 - own + 0.3 * random::normal(s.seed, 9, static_cast<std::uint64_t>(k)))};
    seeker.tell({j, {}});
  }
  return out;
}

double median_arrival(const std::function<GaussianProcessSeekingSettings(std::uint64_t)>& settings, int seeds = 20) {
  std::vector<double> arrivals;
  for (int seed = 0; seed < seeds; ++seed)
    arrivals.push_back(run(settings(static_cast<std::uint64_t>(seed))).arrived);
  std::sort(arrivals.begin(), arrivals.end());
  return arrivals[arrivals.size() / 2];
}

TEST(Surface, ReadsACubicAndItsSlopesBetweenItsNodes) {
  const Surface s = table([](double a, double b) { return 1.0 + 0.1 * a * a * a * b - 3.0 * a * b * b + 7.0 * b; });
  Inputs at(2), slopes(2);
  at << -3.3, 0.17;
  EXPECT_NEAR(s.read(at, slopes), 1.0 + 0.1 * -35.937 * 0.17 + 9.9 * 0.0289 + 1.19, 1e-10);
  EXPECT_NEAR(slopes[0], 0.3 * 10.89 * 0.17 - 3.0 * 0.0289, 1e-10);
  EXPECT_NEAR(slopes[1], 0.1 * -35.937 + 6.0 * 3.3 * 0.17 + 7.0, 1e-9);
}

TEST(Surface, ItsEdgeHoldsBeyondIt) {
  const Surface s = table([](double a, double b) { return a + 100.0 * b; }, -20.0, 10.0);
  Inputs at(2), slopes(2);
  at << -24.0, 0.1;
  EXPECT_NEAR(s.read(at, slopes), -10.0, 1e-10);
  EXPECT_EQ(slopes[0], 0.0);
  EXPECT_NEAR(slopes[1], 100.0, 1e-9);
}

TEST(Surface, RefusesByName) {
  using Axes = std::vector<std::vector<double>>;
  EXPECT_THROW((Surface(Axes{}, {})), ShapeError);
  EXPECT_THROW((Surface(Axes(6, {0.0, 1.0}), std::vector<double>(64))), ShapeError);
  EXPECT_THROW((Surface(Axes{{0.0, 1.0}}, {1.0, 2.0, 3.0})), ShapeError);
  EXPECT_THROW((Surface(Axes{{1.0, 0.0}}, {1.0, 2.0})), ParameterError);
  EXPECT_THROW((Surface(Axes{{0.0, 1.0}}, {1.0, std::nan("")})), ParameterError);
}

TEST(GuidedProcess, AGuideThatIsOffByAFifthHalvesTheReadings) {
  const double plain = median_arrival([](std::uint64_t seed) { return settings_of(seed, nullptr); });
  const double guided = median_arrival([](std::uint64_t seed) { return settings_of(seed, off_by_a_fifth); });
  EXPECT_LE(guided, 6.0);
  EXPECT_LT(guided, plain);
}

TEST(GuidedProcess, AnotherUnitOfTheGuideIsLearnt) {
  const Model large = [](double soc, double egr) { return 300.0 * off_by_a_fifth(soc, egr); };
  EXPECT_LE(median_arrival([&](std::uint64_t seed) { return settings_of(seed, large); }), 9.0);
}

TEST(GuidedProcess, AGuideThatSaysNothingIsLeftBehind) {
  const Model useless = [](double soc, double egr) { return 2.0 * std::sin(0.35 * soc) + 2.0 * std::cos(35.0 * egr); };
  EXPECT_LE(median_arrival([&](std::uint64_t seed) { return settings_of(seed, useless); }), 14.0);
  GaussianProcessSeeking seeker(settings_of(1, useless));
  for (int k = 0; k < 60; ++k) {
    const double j[] = {50.0 - lost(seeker.ask()) + 0.3 * random::normal(1, 9, static_cast<std::uint64_t>(k))};
    seeker.tell({j, {}});
  }
  EXPECT_LT(seeker.guide_factor(), 0.2);
}

// So flat that the noise would explain all that it says: no more readings are taken for outliers than can be.
TEST(GuidedProcess, AGuideThatIsAHundredTimesTooFlatCostsLittle) {
  const auto loss_in_40 = [](double height) {
    std::vector<double> axis, values;
    for (int i = 0; i < 41; ++i)
      axis.push_back(-20.0 + 0.75 * i);
    for (const double x : axis)
      values.push_back(-height * (x - 5.0) * (x - 5.0));
    double sum = 0.0;
    for (std::uint64_t seed = 0; seed < 16; ++seed) {
      GaussianProcessSeekingSettings s;
      s.space.inputs = {{.name = "soc_cad", .lower = -20.0, .upper = 10.0}};
      s.space.start = scalar_input(-18.0 + 26.0 * random::uniform(seed, 5, 0));
      s.seed = seed;
      if (height > 0.0) s.guide = {Surface({axis}, values)};
      GaussianProcessSeeking seeker(s);
      for (int k = 0; k < 40; ++k) {
        const double off = seeker.ask()[0] + 6.0;
        sum += 0.08 * off * off;
        const double j[] = {-0.08 * off * off + 0.25 * random::normal(seed, 9, static_cast<std::uint64_t>(k))};
        seeker.tell({j, {}});
      }
    }
    return sum / 16.0;
  };
  EXPECT_LT(loss_in_40(0.0008), 2.0 * loss_in_40(0.0));
}

// A guide says J itself, also where less is better.
TEST(GuidedProcess, MinimisingIsMaximisingTheNegative) {
  auto down = settings_of(3, [](double soc, double egr) { return -off_by_a_fifth(soc, egr); });
  down.maximize = false;
  EXPECT_EQ(run(settings_of(3, off_by_a_fifth)).lost, run(down).lost);
}

// p_max = 100 + 2 soc + 60 egr, of which the guide knows the shape but not the level.
TEST(GuidedProcess, GuidesOfLimitsKeepThemFromTheFirstStepOn) {
  double above = 0.0, late = 0.0;
  constexpr int seeds = 10, cycles = 40;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    auto s = settings_of(seed, off_by_a_fifth);
    s.space.start << -18.0, 0.3;
    s.limits = {{.name = "p_max_bar", .upper = 110.0}};
    s.limit_guides = {table([](double soc, double egr) { return 150.0 + 2.2 * soc + 50.0 * egr; })};
    GaussianProcessSeeking seeker(s);
    for (int k = 0; k < cycles; ++k) {
      const Inputs x = seeker.ask();
      const double p = 100.0 + 2.0 * x[0] + 60.0 * x[1];
      const auto at = static_cast<std::uint64_t>(k);
      const double j[] = {-lost(x) + 0.3 * random::normal(seed, 9, at)}, limits[] = {p + random::normal(seed, 8, at)};
      seeker.tell({j, limits});
      above += p > 110.0 ? 1.0 / (seeds * cycles) : 0.0;
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LE(above, 0.02);
  EXPECT_LT(late, 1.0);  // the limit cuts the best input off
}

// The noise of the first three readings hides what the guide of a limit says of them: it is not flat for that.
TEST(GuidedProcess, ReadingsOfALimitThatAreAlikeByChanceMakeItNoPlane) {
  const auto nox = [](double soc, double egr) { return 80.0 * std::exp(-0.09 * (soc - 4.0) - 7.0 * (egr - 0.31)); };
  double above = 0.0, worst = 0.0;
  constexpr int seeds = 20, cycles = 12;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    auto s = settings_of(seed, off_by_a_fifth);
    s.limits = {{.name = "nox_ppm", .upper = 110.0}};
    s.limit_guides = {table([&](double soc, double egr) { return 0.7 * nox(soc + 2.0, egr); })};
    GaussianProcessSeeking seeker(s);
    for (int k = 0; k < cycles; ++k) {
      const Inputs x = seeker.ask();
      const double own = nox(x[0], x[1]), read = k < 3 ? 80.0 + 0.1 * k : own;
      const auto at = static_cast<std::uint64_t>(k);
      const double j[] = {-lost(x) + 0.3 * random::normal(seed, 9, at)};
      const double limits[] = {read * (1.0 + 0.02 * random::normal(seed, 8, at) * (k < 3 ? 0.0 : 1.0))};
      seeker.tell({j, limits});
      above += own > 1.01 * 110.0 ? 1.0 / (seeds * cycles) : 0.0;
      worst = std::max(worst, own / 110.0);
    }
  }
  EXPECT_LE(above, 0.02);
  EXPECT_LT(worst, 1.4);
}

// A guide that says a limit is far away: nothing is asked farther out than a first step, or a part of what was asked.
TEST(GuidedProcess, AGuideOfALimitIsNotFollowedFartherThanItWasRead) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    auto s = settings_of(seed, off_by_a_fifth);
    s.limits = {{.name = "nox_ppm", .upper = 500.0}};
    s.limit_guides = {table([](double soc, double egr) { return 10.0 - 0.01 * soc - egr; })};
    GaussianProcessSeeking seeker(s);
    Inputs lowest = s.space.start, highest = lowest;
    for (int k = 0; k < 12; ++k) {
      const Inputs x = seeker.ask(), range = seeker.settings().space.upper - seeker.settings().space.lower;
      const double wide = ((highest - lowest).cwiseQuotient(range)).maxCoeff();
      const double beyond = (x - highest).cwiseMax(lowest - x).cwiseQuotient(range).maxCoeff();
      ASSERT_LE(beyond, std::max(0.1, 0.4 * wide) + 1e-9) << k;
      lowest = lowest.cwiseMin(x);
      highest = highest.cwiseMax(x);
      const double j[] = {-lost(x)}, limits[] = {200.0 * std::exp(-0.1 * (x[0] - 4.0))};
      seeker.tell({j, limits});
    }
  }
}

}  // namespace
}  // namespace mgdd::optimize
