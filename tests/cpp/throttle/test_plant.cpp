// Facts of the throttle plant: rest, breakaway, hysteresis, closed forms, end stops, convergence.
#include "mgdd/throttle/plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mgdd/common/units.hpp"
#include "mgdd/throttle/simulation.hpp"

namespace {

using namespace mgdd::throttle;

constexpr double h = 1e-4;

double deg(double rad) {
  return rad / mgdd::units::rad_per_deg;
}

struct Drive {
  ThrottlePlant plant;
  ThrottleState state;
  ThrottleInput input{};
  explicit Drive(const Throttle& t, double start_deg, double step_s = h) : plant(t, step_s), state(at_rest(start_deg)) {
    input.supply_v = t.supply_v;
  }
  double angle() const { return deg(state.plate_angle_rad); }
  void go(double duty, double seconds) {
    input.duty = duty;
    const auto n = std::lround(seconds / plant.step_s());
    for (long k = 0; k < n; ++k)
      plant.step(state, input);
  }
  // Time until the angle passes `target` in the direction of `sign`.
  double until(double duty, double target, double sign) {
    input.duty = duty;
    long k = 0;
    while (sign * (angle() - target) < 0.0 && k < 1'000'000) {
      plant.step(state, input);
      ++k;
    }
    return static_cast<double>(k) * plant.step_s();
  }
};

TEST(ThrottlePlant, LimpHomeIsTheRestPositionIfThePreloadBeatsTheFriction) {
  for (const double start : {0.0, 30.0, 90.0}) {
    Drive run(Throttle{}, start);
    run.go(0.0, 5.0);
    EXPECT_NEAR(run.angle(), 8.0, 0.25) << start;
    EXPECT_EQ(run.state.speed_rad_per_s, 0.0);
  }
}

TEST(ThrottlePlant, AFrictionAboveThePreloadLeavesABandOfRest) {
  Throttle t;
  t.preload_above_nm = t.preload_below_nm = 0.2;
  t.spring_above_nm_per_rad = t.spring_below_nm_per_rad = 0.819;
  const double band = deg((t.coulomb_nm - 0.2) / 0.819);
  EXPECT_NEAR(band, 5.88, 0.005);
  for (const double above : {10.0, 15.0, 20.0}) {
    Drive run(t, 8.0 + above);
    run.go(0.0, 5.0);
    EXPECT_NEAR(run.angle() - 8.0, band, 0.1) << above;
  }
  const double overrun[] = {2.9, -0.1, -1.1};
  int i = 0;
  for (const double above : {10.0, 15.0, 20.0}) {
    Drive run(t, 8.0 + above);
    run.input.bridge = Bridge::open;
    run.go(0.0, 5.0);
    EXPECT_NEAR(run.angle() - 8.0, overrun[i++], 0.06) << above;
  }
}

}  // namespace
