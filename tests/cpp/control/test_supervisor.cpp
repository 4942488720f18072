// Supervisor of a throttle controller on made-up samples: transparent while all is well, one law per fault, times of
// debouncing, what stays until acknowledged, the balance of a plate, a restart bit for bit, no allocation.
#include "mgdd/control/supervisor.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::control {
namespace {

static_assert(noexcept(std::declval<ThrottleSupervisor&>().observe({})));
static_assert(noexcept(std::declval<ThrottleSupervisor&>().decide(0.0)));
static_assert(noexcept(std::declval<ThrottleSupervisor&>().acknowledge()));

using Mode = SupervisorMode;
using Reason = SupervisorReason;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Both sides of limp-home different, odd thresholds.
SupervisorSettings lively() {
  SupervisorSettings s;
  s.closed_deg = 1.0;
  s.open_deg = 84.0;
  s.limited_open_deg = 35.0;
  s.spring.limp_home_deg = 11.0;
  s.spring.above = {.preload = 0.13, .per_deg = 6e-4};
  s.spring.below = {.preload = 0.17, .per_deg = 9e-4};
  return s;
}

SupervisorInputs at(double angle_deg, double reference_deg) {
  return {.reference_deg = reference_deg, .angle_deg = {angle_deg, angle_deg}, .supply_v = 12.0};
}
SupervisorInputs at(double angle_deg) {
  return at(angle_deg, angle_deg);
}

/// One sample of a plate that is held where it is.
SupervisorOrder hold(ThrottleSupervisor& s, const SupervisorInputs& in) {
  const SupervisorView view = s.observe(in);
  return s.decide(s.settings().spring.at(view.angle_deg));
}
void settle(ThrottleSupervisor& s, double angle_deg, int samples = 100) {
  for (int k = 0; k < samples; ++k)
    ASSERT_EQ(hold(s, at(angle_deg)).mode, Mode::normal) << k;
}

/// Samples of these inputs until the bridge opens; -1 if it does not within 3 s.
int opens_after(ThrottleSupervisor& s, const SupervisorInputs& in, Reason reason) {
  for (int k = 1; k <= 3000; ++k) {
    const SupervisorOrder order = hold(s, in);
    if (order.bridge_open) {
      EXPECT_EQ(order.mode, Mode::limp_home);
      EXPECT_EQ(order.duty, 0.0);
      EXPECT_EQ(order.reason, reason);
      return k;
    }
  }
  return -1;
}

TEST(Supervisor, IsTransparentWhileAllIsWell) {
  ThrottleSupervisor s(lively());
  double angle = 30.0;
  for (int k = 0; k < 5000; ++k) {
    const double reference = 30.0 + 20.0 * std::sin(0.005 * k);
    angle = 30.0 + 20.0 * std::sin(0.005 * (k - 6));
    const double duty = s.settings().spring.at(angle) + 0.1 * std::cos(0.005 * k);
    const SupervisorView view = s.observe(at(angle, reference));
    ASSERT_EQ(view.reference_deg, reference);
    ASSERT_EQ(view.angle_deg, angle);
    const SupervisorOrder order = s.decide(duty);
    ASSERT_EQ(order.duty, duty);
    ASSERT_FALSE(order.bridge_open);
    ASSERT_EQ(order.mode, Mode::normal) << k;
    ASSERT_EQ(order.reason, Reason::none);
  }
  EXPECT_EQ(s.decide(1.7).duty, 1.0);
}

TEST(Supervisor, AReferenceOutsideTheTravelIsLimitedAndStaysReported) {
  for (const auto& [asked, used] : {std::pair{99.0, 84.0}, std::pair{-3.0, 1.0}}) {
    ThrottleSupervisor s(lively());
    settle(s, used);
    EXPECT_EQ(s.observe(at(used, asked)).reference_deg, used);
    EXPECT_EQ(s.decide(0.1).mode, Mode::limited);
    EXPECT_EQ(s.order().reason, Reason::reference_range);
    EXPECT_EQ(s.acknowledge(), Reason::reference_range);
    for (int k = 0; k < 49; ++k)
      EXPECT_EQ(hold(s, at(used)).mode, Mode::limited);
    EXPECT_EQ(s.acknowledge(), Reason::reference_range);  // healthy for 49 ms
    (void)hold(s, at(used));
    EXPECT_EQ(s.acknowledge(), Reason::none);
    EXPECT_EQ(hold(s, at(used)).mode, Mode::normal);
  }
}

TEST(Supervisor, AMissingReferenceHoldsTheLastOneAndThenOpens) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  for (int k = 1; k < 20; ++k) {
    EXPECT_EQ(s.observe(at(30.0, nan)).reference_deg, 30.0);
    const SupervisorOrder order = s.decide(0.15);
    EXPECT_EQ(order.mode, Mode::holding);
    EXPECT_EQ(order.reason, Reason::missing_reference);
    EXPECT_EQ(order.duty, 0.15);
  }
  EXPECT_TRUE(hold(s, at(30.0, nan)).bridge_open);
}

TEST(Supervisor, AShortGapIsHeldFirstByTheLastAngleThenByTheSpringsAndEndsByItself) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  SupervisorInputs gap = at(nan, 50.0);
  for (int k = 1; k < 20; ++k) {
    EXPECT_EQ(s.observe(gap).angle_deg, 30.0);
    const SupervisorOrder order = s.decide(0.9);
    EXPECT_EQ(order.mode, Mode::holding);
    EXPECT_EQ(order.reason, Reason::missing_sample);
    EXPECT_EQ(order.duty, k <= 3 ? 0.9 : s.settings().spring.at(30.0)) << k;
  }
  SupervisorOrder order = hold(s, at(30.0));
  EXPECT_EQ(order.mode, Mode::normal);
  EXPECT_EQ(order.reason, Reason::missing_sample);  // reported until acknowledged
  for (int k = 0; k < 60; ++k)
    order = hold(s, at(30.0));
  EXPECT_EQ(s.acknowledge(), Reason::none);
  EXPECT_EQ(hold(s, at(30.0)).reason, Reason::none);
}

TEST(Supervisor, SilenceOpensWhicheverWayItComes) {
  SupervisorInputs missing = at(nan, 30.0), unknown_age = at(30.0);
  unknown_age.age_s = nan;
  for (const SupervisorInputs& in : {missing, unknown_age}) {
    ThrottleSupervisor s(lively());
    settle(s, 30.0);
    EXPECT_EQ(opens_after(s, in, Reason::missing_sample), 20);
  }
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  SupervisorInputs stale = at(30.0);
  for (int k = 1; k <= 20; ++k) {
    stale.age_s = 1e-3 * k;
    const SupervisorOrder order = hold(s, stale);
    EXPECT_EQ(order.mode, k <= 3 ? Mode::normal : k < 20 ? Mode::holding : Mode::limp_home) << k;
    if (k > 3) {
      EXPECT_EQ(order.reason, Reason::stale_sample);
    }
  }
}

TEST(Supervisor, BeforeTheFirstAngleThePlateIsNotTrustedAndSilenceOpens) {
  ThrottleSupervisor s(lively());
  (void)s.observe(at(nan, 60.0));
  EXPECT_EQ(s.decide(1.0).duty, s.settings().spring.at(11.0));
  EXPECT_GE(opens_after(s, at(nan, 60.0), Reason::missing_sample), 10);
}

TEST(Supervisor, OneSensorOutOfRangeLeavesTheOtherForTheTimeOfDebouncing) {
  for (const double wrong : {1.0 - 6.8, 84.0 + 6.8, nan}) {
    for (const std::size_t which : {0u, 1u}) {
      ThrottleSupervisor s(lively());
      settle(s, 30.0);
      SupervisorInputs in = at(30.5, 30.0);
      in.angle_deg[which] = wrong;
      for (int k = 1; k < 20; ++k) {
        EXPECT_EQ(s.observe(in).angle_deg, 30.5);
        EXPECT_EQ(s.decide(0.2).mode, Mode::holding);
        EXPECT_EQ(s.order().duty, 0.2);
        EXPECT_EQ(s.order().reason, Reason::sensor_range);
      }
      EXPECT_TRUE(hold(s, in).bridge_open);
    }
  }
}

TEST(Supervisor, SensorsThatDisagreeAreBothNotUsedAndAGlitchPasses) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  SupervisorInputs in = at(30.0);
  in.angle_deg[1] = 34.4;
  for (int k = 0; k < 100; ++k)
    EXPECT_EQ(hold(s, in).mode, Mode::normal);
  in.angle_deg = {36.0, 31.5};
  for (int k = 1; k < 20; ++k) {
    EXPECT_EQ(s.observe(in).angle_deg, 30.0);
    EXPECT_EQ(s.decide(0.9).duty, s.settings().spring.at(30.0));
  }
  EXPECT_EQ(hold(s, at(30.0)).mode, Mode::normal);
  EXPECT_EQ(opens_after(s, in, Reason::sensor_disagreement), 20);
}

TEST(Supervisor, TheFlagOfAnotherCheckOpensAtOnce) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  SupervisorInputs in = at(30.0);
  in.sensor_fault = true;
  EXPECT_EQ(opens_after(s, in, Reason::sensor_disagreement), 1);
}

TEST(Supervisor, AControllerThatAnswersNanIsHeldByTheSpringsAndThenOff) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  for (int k = 1; k < 20; ++k) {
    (void)s.observe(at(30.0));
    EXPECT_EQ(s.decide(nan).duty, s.settings().spring.at(30.0));
    EXPECT_EQ(s.order().mode, Mode::holding);
    EXPECT_EQ(s.order().reason, Reason::invalid_duty);
  }
  (void)s.observe(at(30.0));
  EXPECT_TRUE(s.decide(nan).bridge_open);
  EXPECT_EQ(s.order().reason, Reason::invalid_duty);
}

TEST(Supervisor, ALowSupplyLimitsTheReferenceUntilAcknowledgedAndALostOneOpens) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  SupervisorInputs low = at(30.0, 60.0);
  low.supply_v = 8.0;
  for (int k = 1; k < 20; ++k) {
    EXPECT_EQ(s.observe(low).reference_deg, 60.0);
    EXPECT_EQ(s.decide(0.16).mode, Mode::normal);
  }
  EXPECT_EQ(s.observe(low).reference_deg, 35.0);
  EXPECT_EQ(s.decide(0.16).mode, Mode::limited);
  EXPECT_EQ(s.order().reason, Reason::supply_low);
  for (int k = 0; k < 100; ++k)
    (void)hold(s, low);
  EXPECT_EQ(s.acknowledge(), Reason::supply_low);
  SupervisorInputs well = at(30.0, 60.0);
  for (int k = 0; k < 60; ++k) {
    EXPECT_EQ(s.observe(well).reference_deg, 35.0);
    (void)s.decide(0.16);
  }
  EXPECT_EQ(s.acknowledge(), Reason::none);
  EXPECT_EQ(s.observe(well).reference_deg, 60.0);
  (void)s.decide(0.16);

  ThrottleSupervisor lost(lively());
  settle(lost, 30.0);
  low.supply_v = 5.9;
  EXPECT_EQ(opens_after(lost, low, Reason::supply_lost), 20);
  ThrottleSupervisor blind(lively());
  low.supply_v = nan;
  EXPECT_EQ(opens_after(blind, at(30.0), Reason::none), -1);
}

TEST(Supervisor, OfTwoLimitsTheSupplyIsReportedAndTheFirstReasonOfAnOpenBridgeStays) {
  ThrottleSupervisor s(lively());
  SupervisorInputs in = at(30.0, 95.0);
  (void)hold(s, in);
  in.supply_v = 8.0;
  for (int k = 0; k < 20; ++k)
    (void)hold(s, in);
  EXPECT_EQ(s.order().reason, Reason::supply_low);
  in.angle_deg[0] = nan;
  in.supply_v = 3.0;
  EXPECT_EQ(opens_after(s, in, Reason::sensor_range), 20);
  for (int k = 0; k < 50; ++k)
    EXPECT_EQ(hold(s, in).reason, Reason::sensor_range);
}

/// A plate that stands although it is pushed.
int jam(double angle_deg, double reference_deg, double duty, double creep_deg_per_s = 0.0) {
  ThrottleSupervisor s(lively());
  for (int k = 0; k < 100; ++k)
    (void)hold(s, at(angle_deg));
  for (int k = 1; k <= 300; ++k) {
    (void)s.observe(at(angle_deg + 1e-3 * creep_deg_per_s * k, reference_deg));
    if (s.decide(duty).bridge_open) {
      EXPECT_EQ(s.order().reason, Reason::jammed);
      return k;
    }
  }
  return -1;
}

TEST(Supervisor, APlateThatStandsUnderAPushIsJammedOnEitherSideAndEitherWay) {
  EXPECT_EQ(jam(40.0, 60.0, 0.7), 41);  // a push acts one sample before it is judged
  EXPECT_EQ(jam(40.0, 20.0, -0.5), 41);
  EXPECT_EQ(jam(5.0, 9.0, 0.3), 41);
  EXPECT_EQ(jam(9.0, 2.0, -0.6), 41);
}

TEST(Supervisor, NoJamWithoutAnErrorWithoutAPushAgainstTheErrorOrWhileThePlateMoves) {
  EXPECT_EQ(jam(40.0, 41.5, 0.7), -1);
  EXPECT_EQ(jam(40.0, 60.0, 0.3), -1);  // 0.15 above the spring: friction may hold it
  EXPECT_EQ(jam(40.0, 20.0, 0.1), -1);
  EXPECT_EQ(jam(40.0, 60.0, 0.7, 15.0), -1);
  EXPECT_EQ(jam(40.0, 60.0, 0.7, 10.0), 41);
  EXPECT_EQ(jam(84.0, 90.0, 0.8), -1);  // at the stop: the reference is limited to it
}

TEST(Supervisor, NoDutyAboveLimpHomeWithoutComingBackMeansThatTheSpringIsLost) {
  const auto run = [](double angle_deg, double duty) {
    ThrottleSupervisor s(lively());
    for (int k = 0; k < 200; ++k) {
      (void)s.observe(at(angle_deg));
      if (s.decide(k < 100 ? s.settings().spring.at(angle_deg) : duty).bridge_open) {
        EXPECT_EQ(s.order().reason, Reason::spring_lost);
        return k - 100;
      }
    }
    return -1;
  };
  const int above = run(60.0, -0.05), below = run(2.0, 0.03);
  EXPECT_GE(above, 20);
  EXPECT_LE(above, 50);
  EXPECT_GE(below, 20);
  EXPECT_LE(below, 50);
  EXPECT_EQ(run(60.0, 0.05), -1);  // friction may hold that
  EXPECT_EQ(run(60.0, 0.4), -1);   // away from limp-home: no matter of the spring
  EXPECT_EQ(run(13.0, -0.2), -1);  // too near to limp-home to tell
}

TEST(Supervisor, TheImbalanceIsTheDutyThatModelAndMotionDoNotExplain) {
  SupervisorSettings settings = lively();
  settings.uncertainty = 10.0;  // never alarms
  ThrottleSupervisor s(settings);
  const double h = 1e-3, disturbance = 0.06;
  double angle = 30.0, speed = 0.0, duty = 0.0;
  for (int k = 0; k < 600; ++k) {
    (void)s.observe(at(angle));
    if (k > 100) {
      ASSERT_NEAR(s.imbalance(), disturbance, 0.004) << k;
    }
    duty = settings.spring.at(angle) + 0.12 * std::sin(0.02 * k) + disturbance;
    (void)s.decide(duty);
    const double net = duty - settings.spring.at(angle) - disturbance;
    speed += h * (settings.gain_deg_per_s2 * net - speed / settings.time_constant_s);
    angle += h * speed;
  }
}

TEST(Supervisor, ALastingErrorAndALastingLargeDutyOpen) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  EXPECT_EQ(opens_after(s, at(30.0, 39.0), Reason::tracking), 500);
  ThrottleSupervisor sweeping(lively());
  for (int k = 0; k < 3000; ++k)  // late, but on changing sides
    ASSERT_FALSE(hold(sweeping, at(30.0, k / 400 % 2 == 0 ? 39.0 : 21.0)).bridge_open);
  const auto load = [](double angle_deg) {
    ThrottleSupervisor t(lively());
    for (int k = 1; k <= 2000; ++k) {
      (void)t.observe(at(angle_deg));
      if (t.decide(0.95).bridge_open) return k;
    }
    return -1;
  };
  EXPECT_EQ(load(40.0), 1001);
  EXPECT_EQ(load(83.0), -1);
}

TEST(Supervisor, AnOpenBridgeIsAcknowledgedAtLimpHomeOnly) {
  ThrottleSupervisor s(lively());
  settle(s, 40.0);
  EXPECT_EQ(s.return_test(), ReturnTest::none);
  ASSERT_GT(opens_after(s, at(nan, 40.0), Reason::missing_sample), 0);
  for (int k = 1; k < 500; ++k) {
    EXPECT_EQ(hold(s, at(40.0)).duty, 0.0);
    EXPECT_EQ(s.return_test(), k < 400 ? ReturnTest::pending : ReturnTest::failed) << k;
    EXPECT_EQ(s.acknowledge(), Reason::missing_sample);
  }
  (void)hold(s, at(11.9));
  EXPECT_EQ(s.return_test(), ReturnTest::passed);
  EXPECT_EQ(s.acknowledge(), Reason::none);
  const SupervisorOrder order = hold(s, at(11.9));
  EXPECT_EQ(order.mode, Mode::normal);
  EXPECT_EQ(order.reason, Reason::none);
  EXPECT_FALSE(order.bridge_open);
  EXPECT_EQ(s.return_test(), ReturnTest::none);
  settle(s, 11.9, 500);
}

TEST(Supervisor, AnOpenBridgeStaysOpenWhileASensorIsWrongAndNothingButAWordEndsIt) {
  ThrottleSupervisor s(lively());
  SupervisorInputs in = at(11.0, 30.0);
  in.angle_deg[1] = 60.0;
  ASSERT_EQ(opens_after(s, in, Reason::sensor_disagreement), 20);
  for (int k = 0; k < 200; ++k)
    (void)hold(s, in);
  EXPECT_EQ(s.acknowledge(), Reason::sensor_disagreement);
  for (int k = 0; k < 5000; ++k)
    ASSERT_TRUE(hold(s, at(11.0, 30.0)).bridge_open);
  EXPECT_EQ(s.acknowledge(), Reason::none);
  s.reset();
  EXPECT_EQ(s.order().mode, Mode::normal);
}

TEST(Supervisor, TimesAreSecondsAtAnySampleTime) {
  for (const double h : {5e-4, 2e-3, 4e-3}) {
    SupervisorSettings settings = lively();
    settings.sample_s = h;
    ThrottleSupervisor s(settings);
    settle(s, 30.0);
    EXPECT_NEAR(opens_after(s, at(nan, 30.0), Reason::missing_sample) * h, 0.02, 1e-9);
    ThrottleSupervisor other(settings);
    settle(other, 30.0);
    EXPECT_NEAR(opens_after(other, at(30.0, 39.0), Reason::tracking) * h, 0.5, 1e-9);
  }
}

TEST(Supervisor, GoesOnBitForBitFromAnySampleOfAFaultyRun) {
  ThrottleSupervisor first(lively());
  for (int k = 0; k < 900; ++k) {
    ThrottleSupervisor second(lively());
    restore_state(second, save_state(first));
    EXPECT_EQ(second.order().mode, first.order().mode);
    SupervisorInputs in = at(30.0 + 5.0 * std::sin(0.03 * k), k % 90 == 3 ? nan : 32.0);
    if (k % 70 < 6) in.angle_deg[1] = nan;
    if (k > 400) in.supply_v = 8.0;
    if (k > 600) in.age_s = 1e-3 * (k - 600);
    if (k > 700) in = at(11.2);
    for (ThrottleSupervisor* s : {&first, &second}) {
      (void)s->observe(in);
      (void)s->decide(0.15 + 0.1 * std::sin(0.05 * k));
      if (k == 800) {
        EXPECT_EQ(s->acknowledge(), Reason::none);
      }
    }
    ASSERT_EQ(save_state(first), save_state(second)) << k;
  }
  StateColumns bad = save_state(first);
  bad["reason"] = {99.0};
  EXPECT_THROW(restore_state(first, bad), ParameterError);
  bad = save_state(first);
  bad["duty"] = {1.5};
  EXPECT_THROW(restore_state(first, bad), ParameterError);
}

TEST(Supervisor, NoAllocation) {
  ThrottleSupervisor s(lively());
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 2000; ++k) {
    (void)s.observe(at(k % 13 == 0 ? nan : 30.0, k % 7 == 0 ? nan : 30.0));
    (void)s.decide(k % 17 == 0 ? nan : 0.2);
    (void)s.acknowledge();
  }
  EXPECT_EQ(counter.count(), 0u);
}

TEST(Supervisor, EveryBadSettingIsNamedAndEveryNameHasAValue) {
  for (const auto& field : supervisor_fields()) {
    SupervisorSettings s = lively();
    field.in(s) = nan;
    try {
      validate(s);
      ADD_FAILURE() << field.info.name;
    } catch (const ParameterError& error) {
      EXPECT_EQ(error.field, field.info.name);
    }
  }
  const auto refuses = [](auto change, const std::string& field) {
    SupervisorSettings s = lively();
    change(s);
    try {
      ThrottleSupervisor made(s);
      ADD_FAILURE() << field;
    } catch (const ParameterError& error) {
      EXPECT_EQ(error.field, field);
    }
  };
  refuses([](auto& s) { s.open_deg = 0.5; }, "open_deg");
  refuses([](auto& s) { s.limited_open_deg = 85.0; }, "limited_open_deg");
  refuses([](auto& s) { s.spring.limp_home_deg = 0.0; }, "limp_home_deg");
  refuses([](auto& s) { s.supply_lost_v = 9.5; }, "supply_lost_v");
  refuses([](auto& s) { s.late_s = 0.03; }, "late_s");
  EXPECT_EQ(supervisor_mode_names().size(), 4u);
  EXPECT_EQ(supervisor_reason_names().size(), 14u);
  EXPECT_EQ(return_test_names().size(), 4u);
}

}  // namespace
}  // namespace mgdd::control
