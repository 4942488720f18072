// Bounded extremum seeking: a step that no J can enlarge, and the drift of its Lie bracket average.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

BoundedSeekingSettings from(double start) {
  BoundedSeekingSettings s;
  s.space = space_at(scalar_input(start));
  s.kappa = 1.0;
  return s;
}

TEST(BoundedSeeking, StepNeverExceedsAmplitudeTimesOmegaWhateverJDoes) {
  const double omega = 2.0 * pi / 10.0;
  for (const double size : {0.1, 10.0, 1e9}) {
    BoundedSeeking seeker(from(0.0));
    double before = seeker.ask()[0], largest = 0.0;
    for (int k = 0; k < 3000; ++k) {
      cycle_of(seeker, [&](const Inputs&) { return size * random::normal(2, 3, static_cast<std::uint64_t>(k)); });
      const double now = seeker.ask()[0];
      largest = std::max(largest, std::abs(now - before));
      before = now;
    }
    EXPECT_LE(largest, omega * (1.0 + 1e-12));
    EXPECT_GT(largest, 0.9 * omega);
  }
}

TEST(BoundedSeeking, ApproachesWithTheRateOfTheAverage) {
  for (const double kappa : {0.5, 1.0}) {
    BoundedSeekingSettings s = from(8.0);
    s.kappa = kappa;
    BoundedSeeking seeker(s);
    const std::vector<double> path = search(seeker, quadratic, 8000);
    const double tau = 2.0 / (kappa * 2.0 * pi / 10.0 * std::abs(bend));
    EXPECT_NEAR(tau * kappa, 62.4, 0.1);
    const auto begin = std::size_t{30}, end = begin + 10 * static_cast<std::size_t>(tau / 10.0);
    const double slope =
        std::log((path[end] - path.back()) / (path[begin] - path.back())) / static_cast<double>(end - begin);
    EXPECT_NEAR(-slope * tau, 1.0, 0.1) << "kappa " << kappa;
  }
}

TEST(BoundedSeeking, CyclesFromTwelveToOne) {
  for (const double side : {12.0, -12.0}) {
    BoundedSeeking seeker(from(side));
    EXPECT_NEAR(first_within(search(seeker, quadratic, 600), 1.0), 62.4 * std::log(12.0) + 5.0, 16.0) << side;
  }
}

TEST(BoundedSeeking, MinimisingIsMaximisingTheNegative) {
  BoundedSeekingSettings s = from(8.0);
  BoundedSeeking up(s);
  s.maximize = false;
  BoundedSeeking down(s);
  EXPECT_EQ(search(up, quadratic, 600), search(down, [](double x) { return -quadratic(x); }, 600));
}

TEST(BoundedSeeking, TwoInputs) {
  BoundedSeekingSettings s;
  s.space = space_at(inputs({6.0, -5.0}));
  s.kappa = 1.0;
  s.dither = {.amplitude = inputs({1.0, 1.0}), .period = 40, .harmonics = {4, 5}};
  BoundedSeeking seeker(s);
  for (int k = 0; k < 4000; ++k)
    cycle_of(seeker, [](const Inputs& x) { return quadratic(x[0] - 1.0) + quadratic(x[1] + 2.0); });
  EXPECT_LT((seeker.estimate() - inputs({1.0, -2.0})).cwiseAbs().maxCoeff(), 0.3);
}

TEST(BoundedSeeking, RefusesAndAdvises) {
  for (const double bad : {0.0, -1.0, std::nan(""), unlimited}) {
    BoundedSeekingSettings s = from(0.0);
    s.kappa = bad;
    EXPECT_THROW(BoundedSeeking{s}, ParameterError);
  }
  BoundedSeekingSettings s = from(0.0);
  s.kappa = 10.0;
  EXPECT_TRUE(s.advice().empty());
  s.curvature = bend;
  ASSERT_EQ(s.advice().size(), 1u);
  EXPECT_NE(s.advice()[0].find("3.12"), std::string::npos) << s.advice()[0];  // 1/(0.628 0.051 10)
  s.kappa = 3.0;
  EXPECT_TRUE(s.advice().empty());
}

}  // namespace
}  // namespace mgdd::optimize
