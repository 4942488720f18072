// Two masses of the throttle plant at the ends of the share of friction; test_plant_equations.cpp has the rest.
#include <gtest/gtest.h>

#include <cmath>

#include "mgdd/throttle/plant.hpp"
#include "support/throttle_case.hpp"

namespace mgdd::throttle {
namespace {

using test::DrivenThrottle;

// A side of the gap without friction is the limit of a side with next to none.
TEST(ThrottleLaws, ASideWithoutFrictionIsTheLimitOfATinyShare) {
  for (const Friction form : {Friction::coulomb, Friction::stiction, Friction::stribeck, Friction::karnopp,
                              Friction::tanh, Friction::lugre}) {
    for (const bool plate_is_free : {true, false}) {
      const auto with_share = [&](double share) {
        Throttle p;
        p.stiction_nm = 0.31;
        p.backlash = Backlash::compliance;
        p.friction = form;
        p.plate_friction_share = plate_is_free ? share : 1.0 - share;
        return DrivenThrottle(p, 30.0);
      };
      DrivenThrottle none = with_share(0.0);
      DrivenThrottle tiny = with_share(1e-9);
      double worst = 0.0;
      for (int k = 0; k < 5000; ++k) {
        const double duty = 0.2 + 0.4 * std::sin(2.5e-3 * k);
        none.step(duty);
        tiny.step(duty);
        ASSERT_TRUE(std::isfinite(none.angle_deg())) << static_cast<int>(form) << ' ' << k;
        worst = std::fmax(worst, std::abs(none.angle_deg() - tiny.angle_deg()));
      }
      EXPECT_LT(worst, 1e-4) << static_cast<int>(form) << ' ' << plate_is_free;
      EXPECT_GT(std::abs(none.angle_deg() - 30.0), 5.0);
    }
  }
}

// Bristles on both sides of a closed gap share the load as the friction is shared: the deflection is that of one mass.
TEST(ThrottleLaws, PreslidingIsTheSameHoweverTheFrictionIsShared) {
  Throttle whole;
  whole.friction = Friction::lugre;
  whole.inductance_mh = 0.0;
  const auto bend_deg = [](const Throttle& p) {
    DrivenThrottle t(p, 40.0);
    const double balance = t.spring_nm(40.0) / p.stall_torque_nm();
    t.go(balance + 0.2 * p.coulomb_nm / p.stall_torque_nm(), 0.3);
    return t.angle_deg() - 40.0;
  };
  const double expected = bend_deg(whole);
  EXPECT_GT(expected, 0.03);
  Throttle geared = whole;
  geared.backlash = Backlash::compliance;
  geared.backlash_half_deg = 1e-6;
  geared.gear_stiffness_nm_per_rad = 20000.0;
  for (const double share : {0.0, 0.3, 0.8, 1.0}) {
    geared.plate_friction_share = share;
    EXPECT_NEAR(bend_deg(geared), expected, 0.03 * expected) << share;
  }
}

}  // namespace
}  // namespace mgdd::throttle
