// The supervisor and its plate: jams, lost springs, what lasts too long, the way out of an open bridge; times and
// silence of what it watches.
#include "mgdd/control/monitoring.hpp"
#include "support/supervisor_samples.hpp"
#include "support/test.hpp"

namespace mgdd::control {
namespace {

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

TEST(SupervisorOfThePlate, APlateThatStandsUnderAPushIsJammedOnEitherSideAndEitherWay) {
  EXPECT_EQ(jam(40.0, 60.0, 0.7), 41);  // a push acts one sample before it is judged
  EXPECT_EQ(jam(40.0, 20.0, -0.5), 41);
  EXPECT_EQ(jam(5.0, 9.0, 0.3), 41);
  EXPECT_EQ(jam(9.0, 2.0, -0.6), 41);
}

TEST(SupervisorOfThePlate, NoJamWithoutAnErrorWithoutAPushAgainstTheErrorOrWhileThePlateMoves) {
  EXPECT_EQ(jam(40.0, 41.5, 0.7), -1);
  EXPECT_EQ(jam(40.0, 60.0, 0.3), -1);  // 0.15 above the spring: friction may hold it
  EXPECT_EQ(jam(40.0, 20.0, 0.1), -1);
  EXPECT_EQ(jam(40.0, 60.0, 0.7, 15.0), -1);
  EXPECT_EQ(jam(40.0, 60.0, 0.7, 10.0), 41);
  EXPECT_EQ(jam(84.0, 90.0, 0.8), -1);  // at the stop: the reference is limited to it
}

TEST(SupervisorOfThePlate, AJamInFlightIsTimedFromTheStopWhereverTheLastMoveWasCounted) {
  for (const int flight : {10, 11}) {
    ThrottleSupervisor s(lively());
    settle(s, 20.0);
    double angle = 20.0;
    int opened = -1;
    for (int k = 0; k < 150 && opened < 0; ++k) {
      if (k < flight) angle += 0.49;  // below `jam_move_deg` in one sample
      (void)s.observe(at(angle + (k == 40 ? 0.04 : -0.04), 60.0));
      if (s.decide(0.9).bridge_open) opened = k;
    }
    EXPECT_EQ(s.order().reason, Reason::jammed);
    EXPECT_LE(opened - flight, 46) << flight;
  }
}

TEST(SupervisorOfThePlate, ADutyThatFrictionHoldsAloneIsNoJamButALostSpring) {
  ThrottleSupervisor s(lively());
  settle(s, 60.0);
  SupervisorOrder order;
  for (int k = 0; k < 100 && !order.bridge_open; ++k) {
    (void)s.observe(at(60.0, 57.0));
    order = s.decide(-0.09);
  }
  EXPECT_EQ(order.reason, Reason::spring_lost);
}

TEST(SupervisorOfThePlate, AGapDoesNotLookLikeAMove) {
  ThrottleSupervisor s(lively());
  settle(s, 30.0);
  for (int k = 0; k < 10; ++k)
    (void)hold(s, at(nan, 30.0));
  for (int k = 0; k < 60; ++k) {
    (void)hold(s, at(33.0));
    EXPECT_NEAR(s.imbalance(), 0.0, 0.01);
  }
}

TEST(SupervisorOfThePlate, ADutyCountsWithItsSupply) {
  for (const auto& [supply_v, jammed] : {std::pair{12.0, true}, std::pair{9.1, false}}) {
    ThrottleSupervisor s(lively());
    SupervisorInputs in = at(40.0, 47.0);
    in.supply_v = supply_v;
    bool opened = false;
    for (int k = 0; k < 100; ++k) {
      (void)s.observe(in);
      opened = opened || s.decide(0.4).bridge_open;
    }
    EXPECT_EQ(opened, jammed) << supply_v;
  }
}

TEST(SupervisorOfThePlate, NoDutyAboveLimpHomeWithoutComingBackMeansThatTheSpringIsLost) {
  const auto run = [](double angle_deg, double duty) {
    ThrottleSupervisor s(lively());
    for (int k = 0; k < 200; ++k) {
      (void)s.observe(at(angle_deg));
      if (s.decide(k < 100 ? s.settings().plate.spring.at(angle_deg) : duty).bridge_open) {
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

TEST(SupervisorOfThePlate, TheImbalanceIsTheDutyThatModelAndMotionDoNotExplain) {
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
    duty = settings.plate.spring.at(angle) + 0.12 * std::sin(0.02 * k) + disturbance;
    (void)s.decide(duty);
    const double net = duty - settings.plate.spring.at(angle) - disturbance;
    speed += h * (settings.plate.gain_deg_per_s2 * net - speed / settings.plate.time_constant_s);
    angle += h * speed;
  }
}

TEST(SupervisorOfThePlate, ALastingErrorAndALastingLargeDutyOpen) {
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

/// Samples until a plate that swings about 40 deg opens the bridge; the reference moves by `way_deg` every `moves`.
int swings(double half_deg, double period_s, double way_deg = 0.0, int moves = 1) {
  ThrottleSupervisor s(lively());
  settle(s, 40.0);
  for (int k = 1; k <= 2000; ++k) {
    const double reference = 40.0 + (k / moves % 2 == 1 ? way_deg : 0.0);
    const double angle = reference + half_deg * std::sin(2.0 * 3.141592653589793 * 1e-3 * k / period_s);
    if (hold(s, at(angle, reference)).bridge_open) {
      EXPECT_EQ(s.order().reason, Reason::oscillation);
      return k;
    }
  }
  return -1;
}

TEST(SupervisorOfThePlate, ALoopThatSwingsOpensAndOneThatRingsHuntsOrFollowsDoesNot) {
  const int quick = swings(2.5, 0.08);  // six changes of side: between three and four periods
  EXPECT_GT(quick, 240);
  EXPECT_LT(quick, 320);
  EXPECT_GT(swings(1.3, 0.28), 840);
  EXPECT_EQ(swings(0.9, 0.08), -1);               // inside `oscillation_deg`
  EXPECT_EQ(swings(2.5, 0.32), -1);               // 160 ms a side
  EXPECT_EQ(swings(2.5, 0.08, 5.0, 200), -1);     // the reference moves before three periods are over
  EXPECT_EQ(swings(2.5, 0.08, 0.7, 200), quick);  // and may tremble
}

TEST(SupervisorOfThePlate, ADampedRingingIsNoSwing) {
  ThrottleSupervisor s(lively());
  settle(s, 40.0);
  for (int k = 0; k < 1500; ++k) {
    const double t = 1e-3 * k;
    ASSERT_FALSE(hold(s, at(50.0 - 10.0 * std::exp(-t / 0.04) * std::cos(80.0 * t), 50.0)).bridge_open) << k;
  }
}

TEST(SupervisorOfThePlate, AnOpenBridgeIsAcknowledgedAtLimpHomeOnly) {
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

TEST(SupervisorOfThePlate, AnOpenBridgeStaysOpenWhileASensorIsWrongAndNothingButAWordEndsIt) {
  ThrottleSupervisor s(lively());
  SupervisorInputs in = at(11.0, 30.0);
  in.angle_deg[1] = 60.0;
  ASSERT_EQ(opens_after(s, in, Reason::sensor_disagreement), 20);
  for (int k = 0; k < 500; ++k) {
    (void)hold(s, in);
    EXPECT_EQ(s.return_test(), ReturnTest::pending);  // neither sensor can tell
  }
  EXPECT_EQ(s.acknowledge(), Reason::sensor_disagreement);
  for (int k = 0; k < 5000; ++k) {
    (void)s.observe(at(11.0, 30.0));
    ASSERT_TRUE(s.decide(nan).bridge_open);  // nobody asks the controller meanwhile
  }
  EXPECT_EQ(s.acknowledge(), Reason::none);
  s.reset();
  EXPECT_EQ(s.order().mode, Mode::normal);
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

TEST(Monitoring, ATimeOfWholeSamplesLastsThatManyWhateverTheRounding) {
  for (const double sample_s : {1e-3, 7e-4, 0.3}) {
    for (int n = 1; n <= 400; ++n) {
      ASSERT_TRUE(lasted(n, sample_s, n * sample_s)) << n;
      ASSERT_FALSE(lasted(n - 1, sample_s, n * sample_s)) << n;
      ASSERT_FALSE(older(n * sample_s, n * sample_s, sample_s)) << n;
      ASSERT_TRUE(older((n + 1) * sample_s, n * sample_s, sample_s)) << n;
    }
  }
  EXPECT_TRUE(older(inf, 1.0, 0.1));
}

TEST(Monitoring, SilenceGrowsWithTheSamplesUntilAnAgeIsTold) {
  double age_s = 0.5;
  age_s = aged(false, nan, age_s, 0.25);
  EXPECT_EQ(age_s, 0.75);
  age_s = aged(true, 0.125, age_s, 0.25);
  EXPECT_EQ(age_s, 0.125);
}

TEST(Monitoring, APairIsHealthyInRangeAndWithinTheTolerance) {
  const Domain range = closed(0.2, 4.6);
  EXPECT_TRUE(check_pair({0.2, 4.6}, range, 0.0, 0.1).healthy());
  EXPECT_FALSE(check_pair({1.0, 2.0}, range, -0.1, 0.1).agree);
  EXPECT_TRUE(check_pair({1.0, 2.0}, range, -0.0999, 0.1).healthy());
  for (const double wrong : {0.1999, 4.6001, nan, inf}) {
    const PairCheck first = check_pair({wrong, 1.0}, range, 0.0, 0.1);
    EXPECT_FALSE(first.healthy());
    EXPECT_EQ(first.usable(), 1u);
    const PairCheck second = check_pair({1.0, wrong}, range, 0.0, 0.1);
    EXPECT_FALSE(second.healthy());
    EXPECT_EQ(second.usable(), 0u);
    EXPECT_EQ(check_pair({wrong, wrong}, range, 0.0, 0.1).usable(), 0u);
  }
  EXPECT_FALSE(check_pair({1.0, 2.0}, range, nan, 0.1).agree);
}

TEST(Monitoring, AStandstillStartsAnewWhereThePlateMovesOrIsExcused) {
  double anchor_deg = 10.0, samples = 7.0;
  follow_standstill(false, 10.5, 0.5, anchor_deg, samples);
  EXPECT_EQ(samples, 7.0);
  EXPECT_EQ(anchor_deg, 10.0);  // a creep is not followed
  follow_standstill(false, 9.4, 0.5, anchor_deg, samples);
  EXPECT_EQ(samples, 0.0);
  EXPECT_EQ(anchor_deg, 9.4);
  samples = 3.0;
  follow_standstill(true, 9.5, 0.5, anchor_deg, samples);
  EXPECT_EQ(samples, 0.0);
  EXPECT_EQ(anchor_deg, 9.5);
}

}  // namespace
}  // namespace mgdd::control
