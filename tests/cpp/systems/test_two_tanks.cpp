#include "systems/two_tanks.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "support/stepped.hpp"

namespace mgdd::systems {
namespace {

using test_support::stepped;

constexpr Values<double, 9> tanks{0.05, 0.01, 1.0, 0.05, 0.5, 1.0, 12.0, 0.5, 1.0};

Values<double, 4> settled(const Values<double, 9>& p, double voltage, int samples = 5000) {
  Values<double, 4> state{1.0, 2.0, voltage, voltage};
  for (int k = 0; k < samples; ++k)
    state = stepped(TwoTanks{}, p, state, voltage, 4.0);
  return state;
}

TEST(TwoTanks, SteadyLevelsBalanceTheFlows) {
  const auto state = settled(tanks, 2.0);
  EXPECT_NEAR(state[0], 10.0, 1e-9);                              // 0.05 * 2 = 0.01 * level
  EXPECT_NEAR(0.05 * std::sqrt(state[1] - 1.0), 0.1, 1e-9);       // the same flow leaves below
  EXPECT_LE(settled(tanks, 1000.0)[1], TwoTanks{}.lower_brim_v);  // runs over
}

TEST(TwoTanks, OverflowReachesTheLowerTankInPart) {
  const auto state = settled(tanks, 2.6);  // 0.13 in, 0.12 through the outlet at the brim, 0.01 over it
  EXPECT_DOUBLE_EQ(state[0], 12.0);
  EXPECT_NEAR(0.05 * std::sqrt(state[1] - 1.0), 0.12 + 0.5 * 0.01, 1e-9);
}

TEST(TwoTanks, DelayShiftsThePump) {
  Values<double, 9> p = tanks;
  const Values<double, 4> before{5.0, 4.0, 2.0, 1.0};
  for (const auto& [delay, voltage] :
       {std::pair(0.0, 3.0), std::pair(1.0, 2.0), std::pair(1.5, 1.5), std::pair(2.0, 1.0)}) {
    p[8] = delay;
    Values<double, 9> none = tanks;
    none[8] = 0.0;
    const auto delayed = stepped(TwoTanks{}, p, before, 3.0, 4.0);
    const auto direct = stepped(TwoTanks{}, none, before, voltage, 4.0);
    EXPECT_NEAR(delayed[0], direct[0], 1e-12);
    EXPECT_EQ(delayed[2], 3.0);
    EXPECT_EQ(delayed[3], 2.0);
  }
}

TEST(TwoTanks, SensitivitiesAreThoseOfDifferences) {
  Values<Dual<9>, 9> p;
  for (int i = 0; i < 9; ++i)
    p[static_cast<std::size_t>(i)] = Dual<9>::seeded(tanks[static_cast<std::size_t>(i)], i);
  Values<Dual<9>, 4> state{Dual<9>(11.0), Dual<9>(4.0), Dual<9>(2.5), Dual<9>(2.5)};
  const auto input = [](int k) { return 2.3 + 0.4 * std::sin(0.1 * k); };
  const auto run = [&](const Values<double, 9>& q) {
    Values<double, 4> s{11.0, 4.0, 2.5, 2.5};
    for (int k = 0; k < 100; ++k)
      s = stepped(TwoTanks{}, q, s, input(k), 4.0);
    return s[1];
  };
  for (int k = 0; k < 100; ++k)
    state = stepped(TwoTanks{}, p, state, input(k), 4.0);
  for (std::size_t i = 0; i + 1 < 9; ++i) {  // the delay stands on a kink at 1
    Values<double, 9> up = tanks;
    Values<double, 9> down = tanks;
    const double h = 1e-7 * tanks[i];
    up[i] += h;
    down[i] -= h;
    const double slope = (run(up) - run(down)) / (2.0 * h);
    EXPECT_NEAR(state[1].grad[i], slope, 1e-4 * std::abs(slope) + 1e-6) << "parameter " << i;
  }
}

}  // namespace
}  // namespace mgdd::systems
