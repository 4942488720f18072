// The first-principle groups: static friction and its drop, presliding, and the gap between motor and plate.
#include "mgdd/throttle/models/first_principle.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/first_principle_case.hpp"
#include "support/test.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;
using test_support::Groups;
using test_support::options_of;
using test_support::Signal;
using enum test_support::GroupAt;

// Leaves rest at static friction and slides far above the Stribeck speed at Coulomb friction.
TEST(FirstPrinciple, ADropHoldsWithStaticAndSlidesWithCoulombFriction) {
  FirstPrinciple options;
  options.closed_deg = -180.0;
  options.open_deg = 180.0;
  Groups groups{0.02, 5e3, 0.0, 0.0, 0.06, 0.0, 0.0, 8.0, 0.0, 0.35, 7.0, 0.25, 0.0, 0.0, 0.5, 0.0};
  const auto model = options.prepare<double>(groups, 1e-3);
  const auto edge = model.breakaway(model.at_rest(-30.0));
  EXPECT_NEAR(edge.up, 0.06 * 1.35, 1e-15);
  EXPECT_NEAR(edge.down, -0.06 * 1.35, 1e-15);
  for (const double way : {1.0, -1.0}) {
    auto held = model.at_rest(0.0), freed = held;
    for (int k = 0; k < 300; ++k) {
      model.step(held, way * 0.06 * 1.349);
      model.step(freed, way * 0.06 * 1.4);
    }
    EXPECT_EQ(held.angle_deg, 0.0);
    const double w = freed.speed_deg_per_s;
    const double level = 0.06 * (1.0 + 0.35 * std::exp(-std::pow(w / 7.0, 2)));
    EXPECT_NEAR(std::abs(w) / (0.02 * 5e3) + level, 0.06 * 1.4, 1e-7);
    EXPECT_GT(w * way, 0.0);
  }
  groups[drop] = 0.0;
  const auto plain = options.prepare<double>(groups, 1e-3);
  groups[falls] = 50.0;
  const auto other = options.prepare<double>(groups, 1e-3);
  auto a = plain.at_rest(0.0), b = other.at_rest(0.0);
  for (int k = 0; k < 40; ++k) {
    plain.step(a, k < 20 ? 0.3 : -0.2);
    other.step(b, k < 20 ? 0.3 : -0.2);
    ASSERT_EQ(a.angle_deg, b.angle_deg) << "without a drop its speed does nothing";
  }
}

// LuGre: under half the friction the plate bends by half of the presliding and comes back; over it, it slides on.
TEST(FirstPrinciple, PreslidingBendsBeforeItSlides) {
  FirstPrinciple options;
  options.closed_deg = -180.0;
  options.open_deg = 180.0;
  options.substeps = 8;
  const Groups groups{0.02, 5e4, 0.0, 0.0, 0.06, 0.0, 0.0, 8.0, 5e-4, 0.0, 10.0, 0.25, 0.0, 0.15, 0.5, 0.0};
  const auto model = options.prepare<double>(groups, 1e-3);
  auto state = model.at_rest(-20.0);
  for (int k = 0; k < 5; ++k)
    model.step(state, 0.006 * (k + 1));
  for (int k = 0; k < 400; ++k)
    model.step(state, 0.03);
  const double bent = state.angle_deg + 20.0;
  EXPECT_NEAR(state.bristle_deg, 0.5 * 0.15, 1e-6) << "stiffness times deflection balances the duty";
  EXPECT_GT(bent, 0.5 * 0.15);
  EXPECT_LT(bent, 2.0 * 0.15);
  for (int k = 0; k < 400; ++k)
    model.step(state, 0.0);
  EXPECT_LT(state.angle_deg + 20.0, bent - 0.3 * 0.15) << "most of it springs back";
  for (int k = 0; k < 400; ++k)
    model.step(state, 0.09);
  EXPECT_NEAR(state.speed_deg_per_s / (0.02 * 5e4) + 0.06, 0.09, 1e-6);
  EXPECT_NEAR(state.bristle_deg, 0.15, 1e-6);
}

// Between its springs the motor of a throttle with a gap crosses it alone; beyond, motor and plate go together.
TEST(FirstPrinciple, AGapIsCrossedByTheMotorAlone) {
  Groups groups = first_principle_of(asymmetric_throttle());
  const FirstPrinciple options = options_of(asymmetric_throttle());
  const Signal duty = test_support::chirp(0.0, 0.3, 1.0, 3.0, 1.0);
  const auto without = options.prepare<double>(groups, 1e-3);
  groups[half_gap] = 0.3;
  const auto with = options.prepare<double>(groups, 1e-3);
  for (const double angle : {4.0, 11.0, 11.2, 50.0})
    EXPECT_DOUBLE_EQ(with.output(with.at_rest(angle)), angle);
  auto state = with.at_rest(30.0);
  int alone = 0;
  double lowest = 90.0;
  for (const double u : duty) {
    with.step(state, u);
    const double lead = state.angle_deg - with.output(state);
    ASSERT_LE(std::abs(lead), 0.3 + 1e-12);
    if (std::abs(lead) < 0.3 - 1e-9) {
      EXPECT_NEAR(with.output(state), groups[home], 1e-9);
      ++alone;
    }
    lowest = std::min(lowest, with.output(state));
  }
  EXPECT_GT(alone, 3);
  EXPECT_LT(lowest, groups[home] - 3.0);
  auto far = with.at_rest(50.0), there = without.at_rest(50.0);
  for (int k = 0; k < 60; ++k) {
    with.step(far, 0.35);
    without.step(there, 0.35);
    ASSERT_NEAR(with.output(far), without.output(there), 1e-9) << "away from limp-home the gap does nothing";
  }
  EXPECT_GT(without.output(there), 53.0);
  with.correct(far, 51.0, {.angle_gain = 1.0, .speed_gain_per_s = 0.0, .bias_gain_duty_per_deg = 0.0});
  EXPECT_NEAR(with.output(far), 51.0, 1e-12);
}

}  // namespace
}  // namespace mgdd::throttle
