#include "systems/drive_axis.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/identify/free_run_fit.hpp"
#include "support/stepped.hpp"

namespace mgdd::systems {
namespace {

using test_support::stepped;

constexpr Values<double, 9> slide{95.0, 200.0, -37.0, 20.0, 2.0, 0.03, -0.5, -0.02, 3.0};
constexpr DriveAxis axis{35.0, 0.1};

TEST(DriveAxis, SteadySpeedBalancesTheForces) {
  Values<double, 9> p = slide;
  p[7] = p[8] = 0.0;
  for (const double voltage : {2.0, -2.0}) {
    Values<double, 3> state{0.1, 0.0, 0.0};
    for (int k = 0; k < 20000; ++k)
      state = stepped(axis, p, state, voltage, 1e-3);
    const double v = state[1];
    const double sign = v > 0.0 ? 1.0 : -1.0;
    EXPECT_GT(v * voltage, 0.0);
    const double friction = p[3] + p[4] * std::exp(-std::abs(v) / p[5]);
    EXPECT_NEAR(35.0 * voltage - p[6], (p[1] + sign * p[2]) * v + sign * friction, 1e-9);
  }
}

TEST(DriveAxis, BrakesToRestAndStays) {
  Values<double, 3> state{0.0, 0.2, 0.0};
  Values<double, 9> p = slide;
  p[6] = p[7] = p[8] = 0.0;
  for (int k = 0; k < 3000; ++k) {
    state = stepped(axis, p, state, 0.0, 1e-3);
    EXPECT_GE(state[1], 0.0);  // no chatter through zero
  }
  EXPECT_EQ(state[1], 0.0);
}

TEST(DriveAxis, SensitivitiesAreThoseOfDifferences) {
  Values<Dual<9>, 9> p;
  for (int i = 0; i < 9; ++i)
    p[static_cast<std::size_t>(i)] = Dual<9>::seeded(slide[static_cast<std::size_t>(i)], i);
  const Values<double, 3> start{0.12, 0.08, 2.0};
  Values<Dual<9>, 3> state{Dual<9>(start[0]), Dual<9>(start[1]), Dual<9>(start[2])};
  const auto run = [&](const Values<double, 9>& q) {
    Values<double, 3> s = start;
    for (int k = 0; k < 200; ++k)
      s = stepped(axis, q, s, 1.2, 1e-3);
    return s[0];
  };
  for (int k = 0; k < 200; ++k)
    state = stepped(axis, p, state, 1.2, 1e-3);
  for (std::size_t i = 0; i < 9; ++i) {
    const double h = 1e-5 * std::max(1.0, std::abs(slide[i])) * (i == 5 ? 1e-2 : 1.0);
    Values<double, 9> up = slide;
    Values<double, 9> down = slide;
    up[i] += h;
    down[i] -= h;
    const double slope = (run(up) - run(down)) / (2.0 * h);
    EXPECT_NEAR(state[0].grad[i], slope, 1e-5 * std::abs(slope) + 1e-10) << "parameter " << i;
  }
}

TEST(DriveAxis, FitNamesWhatItDoesNotKnow) {
  const std::vector<double> base(slide.begin(), slide.end());
  identify::SimulationRecord record;
  record.input.assign(50, 1.0);
  record.output.assign(50, 0.1);
  record.start = {0.1, 0.0, 0.0};
  EXPECT_THROW((void)identify::fit_free_run(axis, base, {"weight_kg"}, {record}, {}), ParameterError);
  EXPECT_THROW((void)identify::fit_free_run(axis, {1.0}, {"mass_kg"}, {record}, {}), ShapeError);
  std::vector<double> wrong = base;
  wrong[0] = -1.0;
  EXPECT_THROW((void)identify::fit_free_run(axis, wrong, {"coulomb_n"}, {record}, {}), ParameterError);
  EXPECT_NO_THROW((void)identify::fit_free_run(axis, base, {"mass_kg"}, {record}, {}));
}

}  // namespace
}  // namespace mgdd::systems
