// Newton extremum seeking: a rate that does not depend on the curvature, and a Hessian that is the true one.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

NewtonSeekingSettings unclipped(double start) {
  NewtonSeekingSettings s;
  s.space = space_at(scalar_input(start));
  s.initial_hessian = scalar_input(bend);
  s.rate = scalar_input(unlimited);
  return s;
}

TEST(NewtonSeeking, JAndFiveTimesJGiveTheSameTrajectory) {
  std::vector<int> counts;
  for (const double scale : {1.0, 5.0}) {
    NewtonSeeking seeker(unclipped(12.0));
    const auto j = [&](double x) { return scale * quadratic(x); };
    double hessian = 0.0, inverse = 0.0;  // means of the last period: both ripple with the dither
    for (int k = 0; k < 299; ++k) {
      cycle_of(seeker, [&](const Inputs& x) { return j(x[0]); });
      ASSERT_EQ(seeker.estimate()[0], 12.0);
      if (k < 289) continue;
      hessian += seeker.hessian()(0, 0) / 10.0;
      inverse += seeker.inverse_hessian()(0, 0) / 10.0;
    }
    EXPECT_NEAR(hessian, scale * bend, 0.01 * scale * std::abs(bend));
    EXPECT_NEAR(1.0 / inverse, scale * bend, 0.025 * scale * std::abs(bend));
    counts.push_back(first_within(search(seeker, j, 400), 1.0));
  }
  EXPECT_NEAR(counts[0], 117, 3);
  EXPECT_LE(std::abs(counts[0] - counts[1]), 1);
}

TEST(NewtonSeeking, NoiseLeavesTheErrorThatWasFound) {
  double mean = 0.0, square = 0.0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    NewtonSeeking seeker(unclipped(12.0));
    search(seeker, quadratic, 299, 0.25, seed);
    const std::vector<double> path = search(seeker, quadratic, 2400, 0.25, seed + 1000);
    mean += first_within(path, 1.0) / 60.0;
    square += std::pow(rms_of(path, 400, 2400), 2) / 60.0;
  }
  EXPECT_NEAR(mean, 114.0, 12.0);
  EXPECT_NEAR(std::sqrt(square), 0.48, 0.07);
}

TEST(NewtonSeeking, HessianOfThreeInputsWithItsCrossTerms) {
  InputMatrix h(3, 3);
  h << -0.06, 0.02, 0.005, 0.02, -0.05, -0.01, 0.005, -0.01, -0.08;
  const Inputs best = inputs({2.0, -3.0, 1.0});
  const auto j = [&](const Inputs& x) { return 0.5 * (x - best).dot(h * (x - best)); };
  NewtonSeekingSettings s;
  s.space = space_at(inputs({6.0, 1.0, -4.0}));
  s.dither = {.amplitude = inputs({2.0, 1.5, 1.0}), .period = 40, .harmonics = {4, 5, 7}};
  s.time_constant_cycles = 160.0;
  s.initial_hessian = Inputs::Constant(3, -0.05);
  s.initial_inverse = Inputs::Constant(3, -20.0);
  s.hold_cycles = 601;
  NewtonSeeking seeker(s);
  InputMatrix mean = InputMatrix::Zero(3, 3);
  Inputs gradient = Inputs::Zero(3);
  for (int k = 0; k < 600; ++k) {
    cycle_of(seeker, j);
    if (k < 560) continue;
    mean += seeker.hessian() / 40.0;
    gradient += seeker.gradient() / 40.0;
  }
  EXPECT_LT((mean - h).cwiseAbs().maxCoeff(), 1e-3 * 0.08);
  EXPECT_LT((gradient - h * (s.space.start - best)).norm(), 1e-12);
  EXPECT_LT((seeker.inverse_hessian() * h - InputMatrix::Identity(3, 3)).norm(), 0.15);
  for (int k = 0; k < 3000; ++k)
    cycle_of(seeker, j);
  EXPECT_LT((seeker.estimate() - best).norm(), 0.05);
}

TEST(NewtonSeeking, InverseStaysNegativeAndBoundedInTheWorstNoise) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    NewtonSeeking seeker(unclipped(0.0));
    for (int k = 0; k < 500; ++k) {
      cycle_of(seeker, [&](const Inputs&) { return 50.0 * random::normal(seed, 4, static_cast<std::uint64_t>(k)); });
      ASSERT_LT(seeker.inverse_hessian()(0, 0), 0.0);
      ASSERT_GE(seeker.inverse_hessian()(0, 0), -100.0);
    }
  }
}

TEST(NewtonSeeking, MinimisingIsMaximisingTheNegative) {
  NewtonSeekingSettings s = unclipped(8.0);
  NewtonSeeking up(s);
  s.maximize = false;
  NewtonSeeking down(s);
  EXPECT_EQ(search(up, quadratic, 600), search(down, [](double x) { return -quadratic(x); }, 600));
}

TEST(NewtonSeeking, RestartHoldsTheEstimateForAPeriodAndKeepsTheHessian) {
  NewtonSeeking seeker(unclipped(4.0));
  search(seeker, quadratic, 500);
  const double estimate = seeker.estimate()[0], hessian = seeker.hessian()(0, 0);
  seeker.restart();
  for (const double x : search(seeker, [](double x) { return quadratic(x - 9.0); }, 9))
    EXPECT_EQ(x, estimate);
  EXPECT_EQ(seeker.hessian()(0, 0), hessian);
  EXPECT_NEAR(search(seeker, [](double x) { return quadratic(x - 9.0); }, 600).back(), 9.0, 0.1);
}

TEST(NewtonSeeking, RefusesAndAdvises) {
  const auto refused = [](auto change) {
    NewtonSeekingSettings s;
    change(s);
    EXPECT_THROW(NewtonSeeking{s}, ParameterError);
  };
  refused([](auto& s) { s.hold_cycles = 9; });
  refused([](auto& s) { s.initial_hessian = scalar_input(0.1); });
  refused([](auto& s) { s.initial_inverse = scalar_input(0.0); });
  refused([](auto& s) { s.time_constant_cycles = 0.0; });
  refused([](auto& s) { s.hessian_rate = 1.5; });
  refused([](auto& s) { s.riccati_rate = std::nan(""); });
  refused([](auto& s) { s.largest_inverse = -1.0; });
  refused([](auto& s) { s.dither.period = 4; });
  NewtonSeekingSettings wrong;
  wrong.initial_hessian = inputs({-1.0, -1.0});
  EXPECT_THROW(NewtonSeeking{wrong}, ShapeError);
  NewtonSeekingSettings s;
  EXPECT_TRUE(s.advice().empty());
  s.time_constant_cycles = 20.0;
  EXPECT_TRUE(s.advice().empty()) << "two periods are enough";
  s.time_constant_cycles = 15.0;
  ASSERT_EQ(s.advice().size(), 1u);
  EXPECT_NE(s.advice()[0].find("20"), std::string::npos);
}

}  // namespace
}  // namespace mgdd::optimize
