// Safety gate: the duty that leaves, the way through its states, requests, envelope, audit list and refused states.
#include "mgdd/common/error.hpp"
#include "mgdd/rig/safety_gate.hpp"
#include "support/safety_samples.hpp"
#include "support/test.hpp"

namespace mgdd::rig {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

static_assert(noexcept(std::declval<SafetyGate&>().observe({})));
static_assert(noexcept(std::declval<SafetyGate&>().command(0.0)));
static_assert(noexcept(std::declval<SafetyGate&>().request(Request::arm)));
static_assert(noexcept(std::declval<SafetyAudit&>().pop()));

TEST(SafetyGate, PassesADutyWhileAllIsWellAndOnlyInRun) {
  SafetyGate gate(narrow());
  expect_off(gate, SafetyState::init, Reason::none);
  pass(gate, 6);
  EXPECT_EQ(gate.request(Request::arm), Reason::too_few_frames);
  pass(gate, 1);
  EXPECT_EQ(gate.request(Request::run), Reason::wrong_state);
  expect_off(gate, SafetyState::init, Reason::none);
  EXPECT_EQ(gate.request(Request::arm), Reason::none);
  EXPECT_EQ(cycle(gate, healthy(), 0.3), Drive{});
  EXPECT_EQ(gate.request(Request::run), Reason::none);
  for (int k = 0; k < 500; ++k) {
    const double duty = 0.4 * std::sin(0.1 * k);
    const Drive drive = cycle(gate, healthy(), duty);
    ASSERT_EQ(drive.duty, duty) << k;
    ASSERT_FALSE(drive.bridge_open);
    ASSERT_TRUE(drive.send);
  }
  EXPECT_EQ(gate.clamped() + gate.slewed(), 0);
  EXPECT_EQ(gate.request(Request::stop), Reason::none);
  expect_off(gate, SafetyState::armed, Reason::requested);
  EXPECT_EQ(gate.request(Request::disarm), Reason::none);
  expect_off(gate, SafetyState::init, Reason::requested);
}

TEST(SafetyGate, ADutyChangesByTheSlewAtMost) {
  SafetyGate gate = running();
  double before = gate.drive().duty;
  for (const double asked : {0.7, -0.7, 0.1}) {
    for (int k = 0; k < 24; ++k) {
      const double now = cycle(gate, healthy(20.0 + k), asked).duty;
      ASSERT_LE(std::abs(now - before), 0.0625);
      before = now;
    }
    EXPECT_EQ(before, asked);
  }
  EXPECT_GE(gate.slewed(), 9 + 22 + 12);
}

TEST(SafetyGate, AfterTheStartTheDutyGrowsInWithoutAJerk) {
  SafetyEnvelope e = narrow();
  e.ramp_s = 0.25;  // 256 cycles
  e.slew_per_s = 1e6;
  SafetyGate gate(e);
  pass(gate, 7);
  (void)gate.request(Request::arm);
  (void)gate.request(Request::run);
  std::array<double, 300> duty{};
  for (double& now : duty)
    now = cycle(gate, healthy(), 0.5).duty;
  for (std::size_t k = 1; k < duty.size(); ++k)
    ASSERT_GE(duty[k], duty[k - 1]) << k;
  EXPECT_NEAR(duty[127], 0.25, 1e-12);  // half way, by symmetry
  for (std::size_t k = 255; k < duty.size(); ++k)
    ASSERT_EQ(duty[k], 0.5);
  double roughest = 0.0;  // change of the change, also at both ends
  for (std::size_t k = 2; k < duty.size(); ++k)
    roughest = std::max(roughest, std::abs(duty[k] - 2.0 * duty[k - 1] + duty[k - 2]));
  EXPECT_LE(roughest, 0.5 * 5.8 / (256.0 * 256.0));  // 10 / sqrt(3) is the largest curvature of the ramp
  EXPECT_LT(duty[1], 1e-4);
  (void)gate.request(Request::stop);
  (void)gate.request(Request::run);
  EXPECT_LT(cycle(gate, healthy(), 0.5).duty, 1e-5);  // every start anew
}

TEST(SafetyGate, ADutyThatIsNotFiniteIsAFaultUntilAFiniteOneComes) {
  for (const double wrong : {nan, inf, -inf}) {
    SafetyGate gate = running();
    EXPECT_EQ(cycle(gate, healthy(), wrong), Drive{});
    expect_off(gate, SafetyState::fault, Reason::invalid_duty);
    for (int k = 0; k < 30; ++k)
      (void)cycle(gate, healthy(), wrong);
    EXPECT_EQ(gate.request(Request::reset), Reason::invalid_duty);
    pass(gate, 7);
    EXPECT_EQ(gate.request(Request::reset), Reason::too_few_frames);  // the first of them came before it was finite
    pass(gate, 1);
    EXPECT_EQ(gate.request(Request::reset), Reason::none);
    expect_off(gate, SafetyState::init, Reason::requested);
  }
  SafetyEnvelope patient = narrow();
  patient.invalid_duties = 3.0;
  SafetyGate gate = running(patient);
  EXPECT_EQ(cycle(gate, healthy(), nan).duty, 0.125);
  EXPECT_EQ(cycle(gate, healthy(), nan).duty, 0.125);
  EXPECT_EQ(cycle(gate, healthy(), 0.0625).duty, 0.0625);
  pass(gate, 3);  // a good one takes back half of a bad one
  EXPECT_EQ(leaves_after(gate, healthy(), nan), 3);
}

TEST(SafetyGate, ADutyWithoutFactsLimps) {
  SafetyGate gate = running();
  EXPECT_EQ(gate.command(0.125), Drive{});
  expect_off(gate, SafetyState::limp, Reason::not_observed);
  EXPECT_EQ(gate.request(Request::reset), Reason::not_observed);
  pass(gate, 6);
  EXPECT_EQ(gate.request(Request::reset), Reason::too_few_frames);
  pass(gate, 1);
  EXPECT_EQ(gate.request(Request::reset), Reason::none);
}

TEST(SafetyGate, GoodFramesCountNotCycles) {
  SafetyGate gate(narrow());
  SafetyFacts none = healthy();
  none.good_frames = 0;
  for (int k = 0; k < 20; ++k)
    (void)cycle(gate, none);
  EXPECT_EQ(gate.request(Request::arm), Reason::too_few_frames);
  SafetyFacts many = healthy();
  many.good_frames = 3;
  (void)cycle(gate, many);
  (void)cycle(gate, many);
  EXPECT_EQ(gate.request(Request::arm), Reason::too_few_frames);
  (void)cycle(gate, healthy());
  EXPECT_EQ(gate.request(Request::arm), Reason::none);
}

TEST(SafetyGate, WhateverIsOddStartsTheCountOfGoodFramesAnew) {
  std::array<SafetyFacts, 5> odd;
  odd.fill(healthy());
  odd[0].bad_frames = 1;
  odd[1].age_s = 0.01;
  odd[2].sent = false;
  odd[3].missed_deadlines = 1;
  odd[4].sensor_v = {1.5, 3.8};
  for (const SafetyFacts& facts : odd) {
    SafetyGate gate(narrow());
    pass(gate, 6);
    (void)cycle(gate, facts);
    pass(gate, 6);
    EXPECT_EQ(gate.request(Request::arm), Reason::too_few_frames);
    pass(gate, 1);
    EXPECT_EQ(gate.request(Request::arm), Reason::none);
  }
}

TEST(SafetyGate, AbortLimpsAndIsNeverRefused) {
  SafetyGate gate = running();
  SafetyFacts facts = healthy();
  facts.request = Request::abort;
  EXPECT_EQ(cycle(gate, facts), Drive{});
  expect_off(gate, SafetyState::limp, Reason::aborted);
  EXPECT_EQ(gate.request(Request::reset), Reason::too_few_frames);
  EXPECT_EQ(gate.request(Request::abort), Reason::none);
  pass(gate, 200);
  expect_off(gate, SafetyState::limp, Reason::aborted);
  for (const Request no : {Request::arm, Request::run, Request::stop, Request::disarm})
    EXPECT_EQ(gate.request(no), Reason::wrong_state);
  EXPECT_EQ(gate.request(Request::reset), Reason::none);
  expect_off(gate, SafetyState::armed, Reason::requested);
}

TEST(SafetyGate, AFaultOutranksALimpAndTheFirstReasonStays) {
  SafetyGate gate = running();
  SafetyFacts both = healthy();
  both.bus = BusState::off;
  both.sensor_v = {1.5, 3.9};
  (void)cycle(gate, both);
  expect_off(gate, SafetyState::limp, Reason::bus_fault);
  (void)cycle(gate, both);
  (void)cycle(gate, both);
  expect_off(gate, SafetyState::fault, Reason::sensor_disagreement);
  SafetyGate noisy = running();
  both.bus = BusState::active;
  both.bad_frames = 5;
  for (int k = 0; k < 3; ++k)
    (void)cycle(noisy, both);
  expect_off(noisy, SafetyState::fault, Reason::sensor_disagreement);  // in a cycle whose frames were bad too
  SafetyFacts other = healthy();
  other.bus = BusState::off;
  other.sensor_v = {0.0, 0.0};
  for (int k = 0; k < 20; ++k)
    (void)cycle(gate, other);
  expect_off(gate, SafetyState::fault, Reason::sensor_disagreement);
}

TEST(SafetyGate, WhatIsWrongWhileArmedLimpsAndInInitOnlyWaits) {
  SafetyFacts off = healthy();
  off.bus = BusState::off;
  SafetyGate gate(narrow());
  (void)cycle(gate, off);
  expect_off(gate, SafetyState::init, Reason::none);
  EXPECT_EQ(gate.request(Request::arm), Reason::bus_fault);
  pass(gate, 7);
  EXPECT_EQ(gate.request(Request::arm), Reason::none);
  (void)cycle(gate, off);
  expect_off(gate, SafetyState::limp, Reason::bus_fault);
}

// Good for one cycle of every four or twenty: never failing for `sensor_cycles` in a row where these are as many.
TEST(SafetyGate, SensorsThatLookWellNowAndThenAreAFault) {
  SafetyEnvelope e = narrow();
  e.sensor_cycles = 20.0;
  SafetyFacts odd = healthy(), outside = healthy(), away = healthy();
  odd.sensor_v = {1.5, 3.9};
  outside.sensor_v = {0.0, 3.5};
  away.angle_deg = 120.0;
  for (const SafetyFacts& facts : {odd, outside, away}) {
    for (const int every : {4, 20}) {
      SafetyGate gate = running(e);
      int k = 0;
      for (; k < 200 && gate.state() == SafetyState::run; ++k)
        (void)cycle(gate, k % every == every - 1 ? healthy() : facts);
      EXPECT_EQ(gate.state(), SafetyState::fault);
      EXPECT_GE(k, 20);
      EXPECT_LT(k, 40);
    }
    SafetyGate gate = running(e);
    for (int k = 0; k < 3000; ++k)
      (void)cycle(gate, k % 4 == 0 ? facts : healthy());
    EXPECT_EQ(gate.state(), SafetyState::run);
  }
  SafetyFacts swinging = healthy();  // agrees with itself and jumps by 1 V, where half a volt a cycle is a sensor
  SafetyGate gate = running(e);
  int k = 0;
  for (; k < 200 && gate.state() == SafetyState::run; ++k) {
    swinging.sensor_v = std::array{1.5 + 1.5 * (k % 2), 3.5 - 1.5 * (k % 2)};
    (void)cycle(gate, swinging);
  }
  EXPECT_EQ(gate.state(), SafetyState::fault);
}

TEST(SafetyEnvelope, RefusesPairsThatCannotBe) {
  SafetyEnvelope e;
  e.sensor_low_v = e.sensor_high_v;
  EXPECT_THROW(validate(e), ParameterError);
  e = {};
  e.closed_deg = 90.0;
  EXPECT_THROW(validate(e), ParameterError);
  e = {};
  e.rms_duty_to_arm = 0.51;
  EXPECT_THROW(validate(e), ParameterError);
  e = {};
  e.bus_fault_from = BusState::active;
  EXPECT_THROW(SafetyGate{e}, ParameterError);
}

TEST(SafetyGate, AStateThatCannotBeIsRefusedAndChangesNothing) {
  SafetyGate gate = running();
  const StateColumns good = save_state(gate);
  const auto refused = [&](const std::string& column, double value) {
    StateColumns bad = good;
    bad.at(column)[0] = value;
    EXPECT_THROW(restore_state(gate, bad), ParameterError) << column;
    EXPECT_EQ(save_state(gate), good);
  };
  refused("state", 5.0);
  refused("state", 3.0);  // a duty that is not 0 in limp
  refused("reason", 18.0);
  refused("duty", 0.76);
  refused("heat", -0.1);
  refused("heat", 1.1);
  refused("silence_s", -1.0);
  refused("streaks", -1.0);
  refused("counts", -1.0);
  refused("cycle", -1.0);
  refused("healthy_frames", -1.0);
  refused("running", -1.0);
  refused("audit_size", 65.0);
  StateColumns odd = good;
  odd.at("audit_size")[0] = 1.0;
  odd.at("audit_to")[0] = 5.0;
  EXPECT_THROW(restore_state(gate, odd), ParameterError);
}

}  // namespace
}  // namespace mgdd::rig
