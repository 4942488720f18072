// When a column of inputs acts, on a throttle without symmetry.
#include <gtest/gtest.h>

#include <vector>

#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;

constexpr double start_deg = 40.0;

// The inputs of sample k act from k to k + 1, in one run and in many.
TEST(PlantSigns, AColumnActsFromItsOwnSampleOn) {
  const Throttle p = asymmetric_throttle();
  const std::size_t n = 12;
  const std::vector<double> duty(n, 0.3), volts(n, 11.0), torque(n, 0.05);
  const auto runs = [&](const ThrottleSignals& signals) {
    std::vector<double> one(n);
    ThrottleState state = at_rest(start_deg);
    simulate(ThrottlePlant(p), signals, 10, state, {.angle_deg = one});
    const std::vector<ThrottleCase> cases{{p, at_rest(start_deg)}};
    EXPECT_EQ(simulate_many(cases, signals, 10, default_step_s), one);
    return one;
  };
  const std::vector<double> plain = runs({duty, volts, torque});
  const auto expect_change = [&](const ThrottleSignals& signals, double sign, const char* what) {
    const std::vector<double> changed = runs(signals);
    for (std::size_t k = 0; k < n; ++k) {
      if (k <= 5) {
        EXPECT_EQ(changed[k], plain[k]) << what << ' ' << k;
      } else {
        EXPECT_GT(sign * (changed[k] - plain[k]), 1e-6) << what << ' ' << k;
      }
    }
  };
  auto other = duty;
  other[5] = 0.6;
  expect_change({other, volts, torque}, 1.0, "duty");
  other = volts;
  other[5] = 14.0;
  expect_change({duty, other, torque}, 1.0, "supply_v");
  other = torque;
  other[5] = -0.4;
  expect_change({duty, volts, other}, -1.0, "airflow_torque_nm");
  const std::vector<double> own(n, p.supply_v), none(n, 0.0);
  EXPECT_EQ(runs({duty}), runs({duty, own, none})) << "left out: the parameter's supply and no extra torque";
}

}  // namespace
}  // namespace mgdd::throttle
