// Safety gate: one law per hazard, on made-up cycles with numbers that nothing else has.
#include "support/safety_samples.hpp"
#include "support/test.hpp"

namespace mgdd::rig {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

TEST(SafetyHazards, AnOldMeasurementIsBridgedAndThenLimps) {
  SafetyGate gate = running();
  SafetyFacts none = healthy();
  none.good_frames = 0;
  for (int age = 1; age <= 7; ++age) {
    none.age_s = age * 0.0009765625;
    const Drive drive = cycle(gate, none, 0.1875);
    if (age <= 4) {
      ASSERT_EQ(drive.duty, 0.1875) << age;
    } else if (age <= 6) {
      ASSERT_EQ(cycle(gate, none, 0.5).duty, 0.1875);  // held, whatever is asked
      break;
    }
  }
  EXPECT_EQ(leaves_after(gate, none), 1);
  expect_off(gate, SafetyState::limp, Reason::stale);
}

TEST(SafetyHazards, ASilentBusGrowsOldByItself) {
  for (const double age_s : {nan, -1.0}) {
    SafetyGate gate = running();
    SafetyFacts silent;
    silent.age_s = age_s;
    EXPECT_EQ(leaves_after(gate, silent), 4 + 2 + 1);
    expect_off(gate, SafetyState::limp, Reason::stale);
  }
  SafetyGate gate = running();
  SafetyFacts silent;
  silent.age_s = inf;
  EXPECT_EQ(leaves_after(gate, silent), 3);
}

TEST(SafetyHazards, BadFramesInARowLimpAndAGoodOneStartsAnew) {
  SafetyGate gate = running();
  SafetyFacts bad = healthy();
  bad.good_frames = 0;
  bad.bad_frames = 1;
  for (int k = 0; k < 4; ++k)
    (void)cycle(gate, bad);
  (void)cycle(gate, healthy());
  EXPECT_EQ(gate.state(), SafetyState::run);
  EXPECT_EQ(leaves_after(gate, bad), 5);
  expect_off(gate, SafetyState::limp, Reason::bad_frames);
  pass(gate, 6);
  EXPECT_EQ(gate.request(Request::reset), Reason::too_few_frames);
  pass(gate, 1);
  EXPECT_EQ(gate.request(Request::reset), Reason::none);
}

TEST(SafetyHazards, OfFramesOfOneCycleTheWorstOrderCounts) {
  SafetyGate gate = running();
  SafetyFacts mixed = healthy();
  mixed.bad_frames = 2;
  EXPECT_EQ(leaves_after(gate, mixed), -1);  // 2 + 2 in a row at most
  mixed.bad_frames = 3;
  EXPECT_EQ(leaves_after(gate, mixed), 1);  // the last 2, then 3
  SafetyGate fresh = running();
  EXPECT_EQ(leaves_after(fresh, mixed), 2);
}

TEST(SafetyHazards, AWorseBusStateThanAllowedLimpsAndSilences) {
  for (const auto& [from, state] :
       {std::pair{BusState::passive, BusState::passive}, std::pair{BusState::passive, BusState::off},
        std::pair{BusState::off, BusState::off}, std::pair{BusState::warning, BusState::warning}}) {
    SafetyEnvelope e = narrow();
    e.bus_fault_from = from;
    SafetyGate gate = running(e);
    SafetyFacts facts = healthy();
    facts.bus = static_cast<BusState>(static_cast<int>(from) - 1);
    EXPECT_EQ(leaves_after(gate, facts), -1);
    facts.bus = state;
    EXPECT_EQ(leaves_after(gate, facts), 1);
    expect_off(gate, SafetyState::limp, Reason::bus_fault);
    EXPECT_EQ(gate.drive().send, state != BusState::off);
    EXPECT_EQ(gate.request(Request::reset), Reason::bus_fault);
    pass(gate, 7);
    EXPECT_TRUE(gate.drive().send);
    expect_off(gate, SafetyState::limp, Reason::bus_fault);  // the bus came back, and nobody has asked
    EXPECT_EQ(gate.request(Request::reset), Reason::none);
  }
}

TEST(SafetyHazards, CommandsThatDoNotLeaveLimp) {
  SafetyGate gate = running();
  SafetyFacts stuck = healthy();
  stuck.sent = false;
  (void)cycle(gate, stuck);
  (void)cycle(gate, stuck);
  (void)cycle(gate, healthy());
  EXPECT_EQ(leaves_after(gate, stuck), 2);  // the good one took back half of one
  expect_off(gate, SafetyState::limp, Reason::not_sent);
}

TEST(SafetyHazards, DeadlinesMissedInARowLimp) {
  SafetyGate gate = running();
  SafetyFacts late = healthy();
  late.missed_deadlines = 2;
  const std::int64_t before = gate.cycle();
  (void)cycle(gate, late);
  (void)cycle(gate, late);
  EXPECT_EQ(gate.cycle(), before + 6);
  (void)cycle(gate, healthy());
  EXPECT_EQ(leaves_after(gate, late), 3);
  expect_off(gate, SafetyState::limp, Reason::deadlines);
  late.missed_deadlines = 5;
  SafetyGate other = running();
  (void)cycle(other, late);
  EXPECT_EQ(other.state(), SafetyState::run);
  late.missed_deadlines = 6;
  (void)cycle(other, healthy());
  EXPECT_EQ(leaves_after(other, late), 1);
}

TEST(SafetyHazards, OnlyMeasurementsCountAgainstASensor) {
  SafetyGate gate = running();
  SafetyFacts wrong = healthy(), silent;
  wrong.sensor_v = {1.5, 3.8};
  (void)cycle(gate, wrong);
  (void)cycle(gate, wrong);
  for (int k = 0; k < 5; ++k)
    (void)cycle(gate, silent);
  EXPECT_EQ(gate.state(), SafetyState::run);
  (void)cycle(gate, wrong);
  expect_off(gate, SafetyState::fault, Reason::sensor_disagreement);
}

TEST(SafetyHazards, HeatIsTheMeanSquareOfTheDutyAndMustCoolBeforeTheNextStart) {
  SafetyGate gate = running();
  const double start = gate.rms_duty() * gate.rms_duty(), tau_cycles = 2.0 / 0.0009765625;
  int k = 0;
  const double approach = 10;  // cycles of the slew from 1/8 to 3/4
  for (double angle = 0.0; gate.state() == SafetyState::run && k < 10000; ++k)
    (void)cycle(gate, healthy(angle += k % 200 < 100 ? 0.1 : -0.1), 0.75);
  expect_off(gate, SafetyState::limp, Reason::heat);
  const double expected = tau_cycles * std::log((0.5625 - start) / (0.5625 - 0.390625));
  EXPECT_NEAR(k, expected + 0.5 * approach, 5.0);
  int cooling = 0;
  while (gate.request(Request::reset) != Reason::none && cooling < 100000) {
    EXPECT_EQ(gate.cause(), gate.rms_duty() > 0.25 ? Reason::heat : Reason::none);
    (void)cycle(gate, healthy(), 0.0);
    ++cooling;
  }
  EXPECT_NEAR(cooling, tau_cycles * std::log(0.390625 / 0.0625), 10.0);
  EXPECT_EQ(gate.state(), SafetyState::armed);
}

TEST(SafetyHazards, LateCyclesHeatToo) {
  SafetyGate on_time = running(), late = running();
  SafetyFacts facts = healthy();
  facts.missed_deadlines = 3;
  for (int k = 0; k < 4; ++k)
    (void)cycle(on_time, healthy(), 0.125);
  (void)cycle(late, facts, 0.125);
  EXPECT_NEAR(on_time.rms_duty(), late.rms_duty(), 1e-12);
}

TEST(SafetyHazards, APushedPlateThatStandsLimps) {
  for (const double sign : {1.0, -1.0}) {
    SafetyGate gate = running();
    for (int k = 0; k < 400; ++k)
      (void)cycle(gate, healthy(), sign * 0.4375);  // below the duty of a stall
    ASSERT_EQ(gate.state(), SafetyState::run);
    (void)cycle(gate, healthy(), sign * 0.5);
    EXPECT_EQ(leaves_after(gate, healthy(20.5), sign * 0.5), 128);
    expect_off(gate, SafetyState::limp, Reason::stall);
  }
}

TEST(SafetyHazards, APlateThatMovesIsNotStalled) {
  SafetyGate gate = running();
  for (int k = 0; k < 700; ++k)
    (void)cycle(gate, healthy(10.0 + 0.01 * k), 0.5);  // 0.75 deg in 76 cycles
  EXPECT_EQ(gate.state(), SafetyState::run);
}

struct SensorCase {
  std::array<double, 2> volts;
  double angle_deg;
  Reason reason;
};

TEST(SafetyHazards, SensorsOutOfRangeOrApartOrAPlateBeyondItsTravelAreFaults) {
  for (const SensorCase& c :
       {SensorCase{{0.2, 3.7}, 20.0, Reason::sensor_range}, SensorCase{{1.5, 4.6}, 20.0, Reason::sensor_range},
        SensorCase{{nan, 3.5}, 20.0, Reason::sensor_range}, SensorCase{{1.5, inf}, 20.0, Reason::sensor_range},
        SensorCase{{1.5, 3.71}, 20.0, Reason::sensor_disagreement},
        SensorCase{{1.5, 3.29}, 20.0, Reason::sensor_disagreement}, SensorCase{{1.5, 3.5}, 84.5, Reason::travel},
        SensorCase{{1.5, 3.5}, -6.5, Reason::travel}, SensorCase{{1.5, 3.5}, nan, Reason::travel}}) {
    SafetyGate gate = running();
    SafetyFacts wrong = healthy(c.angle_deg);
    wrong.sensor_v = c.volts;
    (void)cycle(gate, wrong);
    (void)cycle(gate, wrong);
    (void)cycle(gate, healthy());  // a glitch passes
    ASSERT_EQ(gate.state(), SafetyState::run);
    EXPECT_EQ(leaves_after(gate, wrong), 2);  // which took back half of one
    expect_off(gate, SafetyState::fault, c.reason);
    SafetyFacts silent;
    silent.age_s = 0.0;
    for (int k = 0; k < 20; ++k)
      (void)cycle(gate, silent);
    EXPECT_EQ(gate.request(Request::reset), c.reason);  // no measurement has shown that it is gone
    pass(gate, 7);
    expect_off(gate, SafetyState::fault, c.reason);
    EXPECT_EQ(gate.request(Request::reset), Reason::none);
    expect_off(gate, SafetyState::init, Reason::requested);
  }
}

TEST(SafetyHazards, ASensorThatJumpsFartherThanThePlateCanIsAFault) {
  SafetyGate gate = running();
  double shift = 0.0;
  for (int k = 0; k < 5; ++k) {
    SafetyFacts moving = healthy();
    moving.sensor_v = {1.5 + (shift += 0.5), 3.5 - shift};
    (void)cycle(gate, moving);
  }
  EXPECT_EQ(gate.state(), SafetyState::run);  // as fast as allowed
  for (int k = 0; k < 5; ++k) {
    SafetyFacts back = healthy();
    back.sensor_v = {1.5 + (shift -= 0.5), 3.5 - shift};
    (void)cycle(gate, back);
  }
  SafetyFacts jump = healthy();
  jump.sensor_v = {3.5, 1.5};
  EXPECT_EQ(leaves_after(gate, jump), 3);  // a jump of 4 cycles
  expect_off(gate, SafetyState::fault, Reason::sensor_slope);
}

TEST(SafetyHazards, NegativeCountsAreNone) {
  SafetyGate gate = running();
  SafetyFacts odd = healthy();
  odd.good_frames = -5;
  odd.bad_frames = -5;
  odd.missed_deadlines = -5;
  odd.age_s = nan;
  EXPECT_EQ(leaves_after(gate, odd), 7);
}

}  // namespace
}  // namespace mgdd::rig
