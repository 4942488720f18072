// Golden section: the bracket shrinks by the golden ratio, comparisons are believed beyond the noise only.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

GoldenSectionSettings between(double lower, double upper, double noise_sd = 0.0) {
  GoldenSectionSettings s;
  s.space = {scalar_input(0.5 * (lower + upper)), scalar_input(lower), scalar_input(upper)};
  s.noise_sd = noise_sd;
  return s;
}

TEST(GoldenSection, BracketShrinksByTheGoldenRatioWithOneNewMeasurementEach) {
  GoldenSection seeker(between(-30.0, 10.0));
  const auto j = [](double x) { return quadratic(x + 5.6); };
  search(seeker, j, 2);
  const double ratio = 0.5 * (std::sqrt(5.0) - 1.0);
  double width = 40.0 * ratio;
  EXPECT_NEAR(seeker.upper() - seeker.lower(), width, 1e-12);
  while (!seeker.converged()) {
    const double lower = seeker.lower(), upper = seeker.upper();
    search(seeker, j, 1);
    EXPECT_TRUE(seeker.lower() == lower || seeker.upper() == upper) << "a cut moves one end only, the last one too";
    width *= ratio;
    EXPECT_NEAR(seeker.upper() - seeker.lower(), width, 1e-9);
    EXPECT_LE(seeker.lower(), -5.6);
    EXPECT_GE(seeker.upper(), -5.6);
  }
  EXPECT_LE(width, 0.02);
  EXPECT_NEAR(seeker.estimate()[0], -5.6, 1e-6) << "the vertex of a parabola is that of a quadratic";
  EXPECT_EQ(seeker.ask()[0], seeker.estimate()[0]);
}

TEST(GoldenSection, FindsTheTopOfAnAsymmetricHill) {
  for (const double top : {-28.0, -11.0, 3.0, 9.5}) {
    GoldenSection seeker(between(-30.0, 10.0));
    search(seeker, [&](double x) { return x < top ? std::tanh(0.1 * (x - top)) : -0.02 * std::abs(x - top); }, 40);
    EXPECT_NEAR(seeker.estimate()[0], top, 0.03);
  }
}

TEST(GoldenSection, NoiseIsAveragedUntilADifferenceIsMoreThanChance) {
  double square = 0.0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    GoldenSection seeker(between(-45.0, 52.0, 0.25));
    const std::vector<double> path = search(seeker, quadratic, 1500, 0.25, seed);
    EXPECT_TRUE(seeker.converged());
    square += path.back() * path.back() / 100.0;
  }
  EXPECT_LT(std::sqrt(square), 0.8);
}

// Ends of the last bracket lie one noise_sd below the top: width sqrt(8 sd/|J''|), about the vertex.
TEST(GoldenSection, TheLastBracketIsAsWideAsTheNoiseAsks) {
  GoldenSection seeker(between(-30.0, 10.0, 0.25));
  const auto j = [](double x) { return -0.04 * (x + 5.6) * (x + 5.6); };
  for (int k = 0; k < 2000 && !seeker.converged(); ++k)
    search(seeker, j, 1);
  ASSERT_TRUE(seeker.converged());
  EXPECT_NEAR(seeker.upper() - seeker.lower(), std::sqrt(8.0 * 0.25 / 0.08), 1e-6);
  EXPECT_NEAR(0.5 * (seeker.upper() + seeker.lower()), -5.6, 1e-6);
}

TEST(GoldenSection, ADrawCutsBothEnds) {
  GoldenSectionSettings s = between(-10.0, 10.0, 1.0);
  s.samples_max = 2;
  GoldenSection seeker(s);
  search(seeker, [](double) { return 3.0; }, 4);
  EXPECT_NEAR(seeker.lower(), -seeker.upper(), 1e-12);
  EXPECT_LT(seeker.upper(), 10.0 * 0.9);
}

TEST(GoldenSection, ABrokenLimitDecidesBeforeJ) {
  GoldenSectionSettings s = between(-30.0, 10.0);
  s.limits = {{"p_max_bar", 100.0}};
  GoldenSection seeker(s);
  for (int k = 0; k < 40; ++k) {
    const double x = seeker.ask()[0];
    const double j[] = {x};                            // the best is at the upper end,
    const double value[] = {100.0 + 2.0 * (x + 4.0)};  // the limit at -4
    seeker.tell({j, value, false});
  }
  EXPECT_NEAR(seeker.estimate()[0], -4.0, 0.05);
}

}  // namespace
}  // namespace mgdd::optimize
