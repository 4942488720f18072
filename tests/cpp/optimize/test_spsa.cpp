// SPSA: a gradient without bias from two measurements in any dimension, and its averaged, blocking and
// second-order variants.
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

}  // namespace
}  // namespace mgdd::optimize
