// Two-sided differences: the exact slope of a quadratic, and where the step size converges.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

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

}  // namespace
}  // namespace mgdd::optimize
