// Seekers by their laws: perturbations at random, differences, and sections of a bracket.
#include <gtest/gtest.h>

#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

/// A negative definite matrix with cross terms, for 1 to 5 inputs.
InputMatrix bowl(Eigen::Index n) {
  InputMatrix h = InputMatrix::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    h(i, i) = -0.04 - 0.01 * static_cast<double>(i);
    if (i > 0) h(i, i - 1) = h(i - 1, i) = 0.012;
  }
  return h;
}

Inputs somewhere(Eigen::Index n) {
  Inputs x(n);
  for (Eigen::Index i = 0; i < n; ++i)
    x[i] = (i % 2 == 0 ? 6.0 : -5.0) + 0.5 * static_cast<double>(i);
  return x;
}

SpsaSettings frozen(Eigen::Index n) {
  SpsaSettings s;
  s.space = space_at(somewhere(n));
  s.schedule = GainSchedule::constant;
  s.gain = scalar_input(1e-300);
  return s;
}

TEST(Spsa, GradientOfAQuadraticHasNoBiasAndTakesTwoMeasurementsInAnyDimension) {
  const int draws = 10'000;
  for (Eigen::Index n = 1; n <= 5; ++n) {
    for (const double c : {0.5, 3.0}) {
      SpsaSettings s = frozen(n);
      s.perturbation = scalar_input(c);
      s.seed = static_cast<std::uint64_t>(n);
      Spsa seeker(s);
      const InputMatrix h = bowl(n);
      Inputs sum = Inputs::Zero(n), squares = sum;
      for (int k = 0; k < draws; ++k) {
        for (int m = 0; m < 2; ++m)
          cycle_of(seeker, [&](const Inputs& x) { return 0.5 * x.dot(h * x); });
        ASSERT_EQ(seeker.iteration(), k + 1);
        sum += seeker.gradient();
        squares += seeker.gradient().cwiseAbs2();
      }
      EXPECT_EQ(seeker.estimate(), s.space.start);
      EXPECT_EQ(seeker.protocol().cycle, 2 * draws);
      const Inputs truth = h * s.space.start;
      for (Eigen::Index i = 0; i < n; ++i) {
        const double mean = sum[i] / draws;
        const double error = std::sqrt(std::max(0.0, squares[i] / draws - mean * mean) / draws);
        EXPECT_NEAR(mean, truth[i], 3.0 * error + 1e-12) << n << " inputs, c " << c << ", entry " << i;
      }
    }
  }
}

TEST(Spsa, AveragingDividesTheVarianceOfTheGradient) {
  std::vector<double> variance;
  for (const int q : {1, 4}) {
    SpsaSettings s = frozen(3);
    s.averaging = q;
    Spsa seeker(s);
    EXPECT_EQ(seeker.measurements_per_iteration(), 2 * q);
    double sum = 0.0, square = 0.0;
    const int draws = 4000;
    for (int k = 0; k < draws * 2 * q; ++k) {
      cycle_of(seeker, [&](const Inputs& x) { return 0.5 * x.dot(bowl(3) * x); });
      if ((k + 1) % (2 * q) != 0) continue;
      sum += seeker.gradient()[0];
      square += seeker.gradient()[0] * seeker.gradient()[0];
    }
    variance.push_back(square / draws - sum * sum / draws / draws);
  }
  EXPECT_NEAR(variance[0] / variance[1], 4.0, 0.4);
}

TEST(Spsa, SecondOrderLearnsTheHessian) {
  for (Eigen::Index n = 1; n <= 5; ++n) {
    SpsaSettings s = frozen(n);
    s.form = SpsaForm::second_order;
    s.hessian_prior = 1.0;
    Spsa seeker(s);
    EXPECT_EQ(seeker.measurements_per_iteration(), 4);
    for (int k = 0; k < 4 * 20'000; ++k)
      cycle_of(seeker, [&](const Inputs& x) { return 0.5 * x.dot(bowl(n) * x); });
    EXPECT_LT((seeker.hessian() - bowl(n)).cwiseAbs().maxCoeff(), 0.004) << n << " inputs";
  }
}

TEST(Spsa, BlockingRefusesAStepThatMakesJWorse) {
  SpsaSettings s;
  s.space = space_at(scalar_input(5.0));
  s.schedule = GainSchedule::constant;
  s.gain = scalar_input(2.5 / std::abs(bend));  // every step overshoots: |1 - 2.5| > 1
  s.step_max = scalar_input(1e3);
  Spsa free(s);
  EXPECT_GT(std::abs(search(free, quadratic, 40).back()), 100.0);
  s.blocking = true;
  Spsa guarded(s);
  EXPECT_EQ(guarded.measurements_per_iteration(), 3);
  for (const double x : search(guarded, quadratic, 300))
    EXPECT_LE(std::abs(x), 7.5 + 1e-9);  // the first step has nothing to be compared with
  EXPECT_GT(guarded.blocked(), 90);
}

GradientDescentSettings from(double start, double step_size) {
  GradientDescentSettings s;
  s.space = space_at(scalar_input(start));
  s.step_size = scalar_input(step_size);
  return s;
}

TEST(GradientDescent, StepsByTheStepSizeTimesTheExactSlope) {
  GradientDescent seeker(from(-9.0, 18.0));
  const std::vector<double> path = search(seeker, quadratic, 6);
  EXPECT_EQ(path[1], -9.0);
  EXPECT_NEAR(path[2], -9.0 * (1.0 - 18.0 * 0.051), 1e-12);
  EXPECT_NEAR(path[4], path[2] * (1.0 - 18.0 * 0.051), 1e-12);
  EXPECT_NEAR(seeker.gradient()[0], bend * path[4], 1e-12);
}

TEST(GradientDescent, ConvergesBelowTwiceTheInverseCurvatureOnly) {
  GradientDescent fast(from(-9.0, 18.0));
  search(fast, quadratic, 120);
  EXPECT_EQ(fast.converged_at(), 4);
  EXPECT_EQ(fast.iteration(), 60);
  EXPECT_NEAR(fast.estimate()[0], 0.0, 1e-9);
  GradientDescentSettings wild = from(-9.0, 45.0);
  wild.space.lower[0] = -20.0;
  wild.space.upper[0] = 20.0;
  GradientDescent seeker(wild);
  search(seeker, quadratic, 400);
  EXPECT_EQ(seeker.converged_at(), -1);
  EXPECT_NEAR(std::abs(seeker.estimate()[0]), 19.0, 1e-9) << "thrown from bound to bound";
}

TEST(GradientDescent, LooksForConvergenceWithinItsIterationsAndGoesOn) {
  GradientDescentSettings s = from(-9.0, 2.0);
  s.iterations = 20;
  GradientDescent seeker(s);
  search(seeker, quadratic, 400);
  EXPECT_EQ(seeker.converged_at(), -1);
  EXPECT_LT(std::abs(seeker.estimate()[0]), 0.01);
  seeker.restart();
  EXPECT_EQ(seeker.iteration(), 0);
  search(seeker, quadratic, 2);
  EXPECT_EQ(seeker.converged_at(), 1);
}

TEST(GradientDescent, TakesTwoCyclesPerInput) {
  InputMatrix h(3, 3);
  h << -0.06, 0.02, 0.0, 0.02, -0.05, -0.01, 0.0, -0.01, -0.08;
  GradientDescentSettings s;
  s.space = space_at(inputs({4.0, -3.0, 5.0}));
  s.step_size = scalar_input(15.0);
  GradientDescent seeker(s);
  for (int k = 0; k < 6; ++k)
    cycle_of(seeker, [&](const Inputs& x) { return 0.5 * x.dot(h * x); });
  EXPECT_EQ(seeker.iteration(), 1);
  EXPECT_LT((seeker.gradient() - h * s.space.start).norm(), 1e-12);
  for (int k = 0; k < 600; ++k)
    cycle_of(seeker, [&](const Inputs& x) { return 0.5 * x.dot(h * x); });
  EXPECT_LT(seeker.estimate().norm(), 1e-6);
}

TEST(GradientDescent, RateClipsEveryStep) {
  GradientDescentSettings s = from(30.0, 18.0);
  s.rate = scalar_input(2.0);
  GradientDescent seeker(s);
  EXPECT_NEAR(search(seeker, quadratic, 10).back(), 20.0, 1e-12);
}

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
