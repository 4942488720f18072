// Sliding mode of a plate: what the laws promise on a plant that the model matches, bounds, integrals that do not wind
// up, mirrored plants, both scalars, a restart bit for bit, no allocation.
#include "mgdd/control/sliding_mode.hpp"

#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::control {
namespace {

static_assert(noexcept(std::declval<SlidingMode&>().step(0.0, 0.0)));
static_assert(noexcept(std::declval<BasicSlidingMode<float>&>().step(0.0F, 0.0F)));

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double gain = 20000.0;

/// For a double integrator whose speed is known exactly.
SlidingModeSettings frictionless(ReachingLaw law) {
  SlidingModeSettings s;
  s.reaching = law;
  s.plate.gain_deg_per_s2 = gain;
  s.plate.time_constant_s = 1e9;
  s.plate.spring.above = s.plate.spring.below = {0.0, 0.0};
  s.plate.friction = 0.0;
  s.derivative_lag_s = 0.0;
  s.bandwidth_per_s = 40.0;
  s.integral_per_s = 0.0;
  s.switching = 0.3;
  s.layer_deg = law == ReachingLaw::boundary_layer ? 0.2 : 0.0;
  return s;
}

/// Every part at work, both sides of limp-home different.
SlidingModeSettings lively(ReachingLaw law) {
  SlidingModeSettings s;
  s.reaching = law;
  s.plate.spring.limp_home_deg = 11.0;
  s.plate.spring.above = {.preload = 0.13, .per_deg = 6e-4};
  s.plate.spring.below = {.preload = 0.17, .per_deg = 9e-4};
  s.layer_deg = 2.5;
  return s;
}

struct DoubleIntegrator {
  double angle_deg = 0.0, speed_deg_per_s = 0.0;

  void step(double duty) {
    speed_deg_per_s += 1e-3 * gain * duty;
    angle_deg += 1e-3 * speed_deg_per_s;
  }
};

double reference_of(int k) {
  return k < 150 ? 30.0 : 14.0 + 9.0 * std::sin(0.01 * k);
}
double measurement_of(int k) {
  return 12.0 + 8.0 * std::sin(0.013 * k) + 0.02 * std::cos(2.1 * k);
}

/// Largest |s| from sample `from` on, and where the plate ends.
struct Settled {
  double surface = 0.0, error_deg = 0.0, travelled_duty = 0.0;
};
Settled run(const SlidingModeSettings& settings, const std::function<double(int)>& disturbance, int from, int samples) {
  SlidingMode controller(settings);
  DoubleIntegrator plate;
  Settled out;
  double before = 0.0;
  for (int k = 0; k < samples; ++k) {
    const double duty = controller.step(30.0, plate.angle_deg);
    if (k >= from) {
      out.surface = std::max(out.surface, std::abs(controller.surface_deg_per_s()));
      out.travelled_duty += std::abs(duty - before);
    }
    before = duty;
    plate.step(duty + disturbance(k));
  }
  out.error_deg = 30.0 - plate.angle_deg;
  return out;
}

TEST(SlidingMode, SuperTwistingReachesTheSurfaceInFiniteTimeAndStaysThereUnderADisturbanceThatMoves) {
  SlidingModeSettings s = frictionless(ReachingLaw::super_twisting);
  s.root_per_root_deg_per_s = 0.02;
  s.twist_per_s = 1.5;
  const auto swell = [](int k) { return 0.1 + 0.05 * std::sin(0.02 * k); };  // at most 1 per s
  const double one_sample = 1e-3 * gain * 1e-3;                              // deg/s by a duty of 1 per s
  EXPECT_GT(run(s, swell, 0, 20).surface, 20.0 * one_sample);
  EXPECT_LT(run(s, swell, 400, 2000).surface, 4.5 * one_sample);
  // A rate beyond twist_per_s is not removed.
  s.twist_per_s = 0.3;
  EXPECT_GT(run(s, swell, 400, 2000).surface, 4.5 * one_sample);
}

TEST(SlidingMode, TheRootOfSuperTwistingIsTakenAtTheEndOfTheSample) {
  SlidingModeSettings s = frictionless(ReachingLaw::super_twisting);
  s.bandwidth_per_s = 1e-12;  // s is the speed
  s.root_per_root_deg_per_s = 0.02;
  s.twist_per_s = 0.0;
  for (const double speed : {0.3, 2.0, -7.0}) {
    SlidingMode controller(s);
    (void)controller.step(0.0, 0.0);
    const double duty = controller.step(0.0, 1e-3 * speed);
    const double end = speed + 1e-3 * gain * duty;
    EXPECT_GT(end * speed, 0.0);
    EXPECT_NEAR(end + std::copysign(1e-3 * gain * 0.02 * std::sqrt(std::abs(end)), end), speed, 1e-9);
    EXPECT_EQ(save_state(controller).at("twist")[0], 0.0);
    controller.reset();
    EXPECT_EQ(controller.duty(), 0.0);
  }
}

TEST(SlidingMode, SuperTwistingLeavesNoErrorUnderAConstantDisturbanceAndABoundaryLayerDoes) {
  const auto constant = [](int) { return 0.1; };
  SlidingModeSettings s = frictionless(ReachingLaw::super_twisting);
  s.root_per_root_deg_per_s = 0.02;
  s.twist_per_s = 1.5;
  EXPECT_NEAR(run(s, constant, 0, 2000).error_deg, 0.0, 1e-6);
  s = frictionless(ReachingLaw::boundary_layer);
  EXPECT_NEAR(run(s, constant, 0, 2000).error_deg, -0.2 * 0.1 / 0.3, 1e-6);  // s = layer d/eta
  s.integral_per_s = 5.0;
  EXPECT_NEAR(run(s, constant, 0, 4000).error_deg, 0.0, 1e-6);
}

TEST(SlidingMode, TheImplicitLawDoesNotChatterWhereTheThinLayerDoes) {
  const auto constant = [](int) { return 0.1; };
  SlidingModeSettings s = frictionless(ReachingLaw::boundary_layer);
  s.layer_deg = 1e-3;
  const Settled thin = run(s, constant, 600, 1600);
  s.reaching = ReachingLaw::implicit;
  const Settled implicit = run(s, constant, 600, 1600);
  EXPECT_GT(thin.travelled_duty, 100.0);
  EXPECT_LT(implicit.travelled_duty, 1e-6);
  EXPECT_LT(std::abs(implicit.error_deg), 0.06);  // what one sample carries, in angle
}

TEST(SlidingMode, OnTheSurfaceTheErrorDecaysWithTheBandwidth) {
  SlidingModeSettings s = frictionless(ReachingLaw::implicit);
  s.reference_pole_per_s = 1e4;  // a reference that is there at once
  SlidingMode controller(s);
  DoubleIntegrator plate{29.0, 0.0};
  double before = 0.0;
  for (int k = 0; k < 120; ++k) {
    plate.step(controller.step(30.0, plate.angle_deg));
    const double error = 30.0 - plate.angle_deg;
    if (k > 60) {
      EXPECT_NEAR(error / before, std::exp(-40.0 * 1e-3), 3e-3) << k;
    }
    before = error;
  }
}

TEST(SlidingMode, TheModelHoldsThePlateAgainstItsSpring) {
  const SlidingModeSettings s = lively(ReachingLaw::implicit);
  SlidingMode controller(s);
  EXPECT_NEAR(controller.step(31.0, 31.0), 0.13 + 6e-4 * 20.0, 1e-15);
  controller.reset();
  EXPECT_NEAR(controller.step(3.0, 3.0), -0.17 - 9e-4 * 8.0, 1e-15);
}

TEST(SlidingMode, StartsAtTheMeasurementWithoutAJumpOfTheFilteredReference) {
  SlidingMode controller(lively(ReachingLaw::implicit));
  (void)controller.step(60.0, 20.0);
  EXPECT_LT(std::abs(controller.surface_deg_per_s()), 3500.0);  // 40 deg at once were 5440
  EXPECT_GT(controller.duty(), 0.5);
}

TEST(SlidingMode, ABoundHoldsTheIntegrals) {
  for (const ReachingLaw law : {ReachingLaw::boundary_layer, ReachingLaw::super_twisting}) {
    SlidingModeSettings s = lively(law);
    s.duty.upper = 0.2;
    s.integral_layers = 1e6;
    SlidingMode controller(s);
    for (int k = 0; k < 4000; ++k)
      EXPECT_LE(controller.step(60.0, 20.0), 0.2);
    const StateColumns held = save_state(controller);
    EXPECT_LT(std::abs(held.at("integral_deg_s")[0]), 0.2);
    EXPECT_LT(std::abs(held.at("twist")[0]), 0.2);
  }
}

class EveryLaw : public testing::TestWithParam<ReachingLaw> {};

TEST_P(EveryLaw, AMirroredPlantIsDrivenByTheMirroredDuty) {
  SlidingModeSettings s = lively(GetParam());
  s.plate.spring.limp_home_deg = 32.0;
  SlidingModeSettings mirrored = s;
  std::swap(mirrored.plate.spring.above, mirrored.plate.spring.below);
  SlidingMode one(s), other(mirrored);
  for (int k = 0; k < 800; ++k) {
    const double r = 21.0 + reference_of(k), y = 21.0 + measurement_of(k);
    EXPECT_NEAR(one.step(r, y), -other.step(64.0 - r, 64.0 - y), 1e-9) << k;
  }
}

TEST_P(EveryLaw, FloatAgreesWithDouble) {
  SlidingMode wide(lively(GetParam()));
  BasicSlidingMode<float> narrow(lively(GetParam()));
  for (int k = 0; k < 600; ++k) {
    const auto r = static_cast<float>(reference_of(k)), y = static_cast<float>(measurement_of(k));
    EXPECT_NEAR(narrow.step(r, y), wide.step(r, y), 2e-3) << k;
  }
}

TEST_P(EveryLaw, NoAllocationAndFiniteWhateverComes) {
  SlidingMode controller(lively(GetParam()));
  BasicSlidingMode<float> narrow(lively(GetParam()));
  const test_support::AllocationCounter counter;
  EXPECT_EQ(controller.step(nan, 20.0), 0.0);
  for (int k = 0; k < 1000; ++k) {
    const double duty = controller.step(k % 5 == 1 ? nan : reference_of(k), k % 7 == 2 ? nan : measurement_of(k));
    EXPECT_TRUE(std::abs(duty) <= 1.0);
    (void)narrow.step(static_cast<float>(reference_of(k)), static_cast<float>(measurement_of(k)));
  }
  EXPECT_EQ(counter.count(), 0u);
}

INSTANTIATE_TEST_SUITE_P(SlidingMode, EveryLaw,
                         testing::Values(ReachingLaw::boundary_layer, ReachingLaw::implicit,
                                         ReachingLaw::super_twisting));

}  // namespace
}  // namespace mgdd::control
