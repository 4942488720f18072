// Envelope, audit list and saved state of the safety gate.
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"
#include "support/safety_samples.hpp"

namespace mgdd::rig {
namespace {

TEST(SafetyEnvelope, RefusesWhatLiesOutsideEveryDomainNamingTheField) {
  for (const auto& field : envelope_fields()) {
    for (const double wrong : {field.info.domain.upper * 1.01 + 1.0, std::numeric_limits<double>::quiet_NaN()}) {
      if (!(wrong < unbounded) && wrong == wrong) continue;
      SafetyEnvelope e;
      field.in(e) = wrong;
      try {
        validate(e);
        ADD_FAILURE() << field.info.name;
      } catch (const ParameterError& error) {
        EXPECT_EQ(error.field, field.info.name);
      }
    }
  }
  EXPECT_NO_THROW(validate(SafetyEnvelope{}));
  EXPECT_NO_THROW(validate(narrow()));
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

TEST(SafetyAudit, TellsEveryChangeInOrderWithItsReasonAndCount) {
  SafetyGate gate(narrow());
  pass(gate, 7);
  for (int k = 1; k <= 2; ++k) {
    if (k == 1) (void)gate.request(Request::arm);
    (void)gate.request(Request::run);
    (void)gate.command(0.1);  // of the cycle that was observed
    (void)gate.command(0.1);
    pass(gate, 7);
    (void)gate.request(Request::reset);
  }
  using enum SafetyState;
  const AuditEntry expected[] = {{7, init, armed, Reason::requested, 1},  {7, armed, run, Reason::requested, 2},
                                 {7, run, limp, Reason::not_observed, 1}, {14, limp, armed, Reason::requested, 3},
                                 {14, armed, run, Reason::requested, 4},  {14, run, limp, Reason::not_observed, 2},
                                 {21, limp, armed, Reason::requested, 5}};
  for (const AuditEntry& entry : expected) {
    const auto found = gate.audit().pop();
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->cycle, entry.cycle);
    EXPECT_EQ(found->from, entry.from);
    EXPECT_EQ(found->to, entry.to);
    EXPECT_EQ(found->reason, entry.reason);
    EXPECT_EQ(found->count, entry.count);
  }
  EXPECT_FALSE(gate.audit().pop().has_value());
  EXPECT_EQ(gate.count(Reason::not_observed), 2);
}

TEST(SafetyAudit, AFullListKeepsTheOldEntriesAndCountsTheRest) {
  SafetyAudit audit;
  for (std::int64_t round = 0; round < 3; ++round) {
    for (std::int64_t k = 0; k < 70; ++k)
      audit.push({.cycle = 100 * round + k, .count = k});
    EXPECT_EQ(audit.size(), SafetyAudit::capacity);
    EXPECT_EQ(audit.dropped(), 6 * (round + 1));
    for (std::int64_t k = 0; k < 64; ++k)
      ASSERT_EQ(audit.pop(), (AuditEntry{.cycle = 100 * round + k, .count = k}));
    EXPECT_FALSE(audit.pop().has_value());
  }
}

/// Random cycles, most of them healthy, from a counter: call k gives the same whenever it is asked.
SafetyFacts random_facts(std::uint64_t seed, std::uint64_t k) {
  const auto dice = [&](std::uint64_t which) {
    return 0.5 * std::erfc(-random::normal(seed, which, k) / std::sqrt(2.0));
  };
  SafetyFacts f = healthy(20.0 + 3.0 * random::normal(seed, 1, k));
  const double kind = dice(0);
  if (kind < 0.06) f = {};
  if (kind > 0.06 && kind < 0.08) f.bad_frames = 4;
  if (kind > 0.08 && kind < 0.09) f.bus = BusState::passive;
  if (kind > 0.09 && kind < 0.12) f.sensor_v = {1.5 + random::normal(seed, 2, k), 3.5};
  if (kind > 0.12 && kind < 0.14) f.missed_deadlines = 7;
  if (kind > 0.14 && kind < 0.5) f.request = static_cast<Request>(static_cast<int>(7.0 * dice(3)));
  return f;
}
double random_duty(std::uint64_t seed, std::uint64_t k) {
  const double duty = 0.5 * random::normal(seed, 4, k);
  return duty > 1.6 ? std::numeric_limits<double>::quiet_NaN() : duty;
}

TEST(SafetyGate, ASavedStateGoesOnBitForBitWithItsAuditList) {
  std::set<SafetyState> seen;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SafetyEnvelope e = narrow();
    e.good_frames = 3.0;
    SafetyGate gate(e);
    for (std::uint64_t k = 0; k < 37 * seed; ++k)
      (void)cycle(gate, random_facts(seed, k), random_duty(seed, k));
    seen.insert(gate.state());
    SafetyGate other(e);
    restore_state(other, save_state(gate));
    EXPECT_EQ(other.audit().size(), gate.audit().size());
    for (std::uint64_t k = 0; k < 300; ++k) {
      const SafetyFacts facts = random_facts(seed + 1000, k);
      const double duty = random_duty(seed + 1000, k);
      ASSERT_EQ(cycle(gate, facts, duty), cycle(other, facts, duty));
      ASSERT_EQ(save_state(gate), save_state(other));
    }
    for (auto entry = gate.audit().pop(); entry; entry = gate.audit().pop())
      ASSERT_EQ(entry, other.audit().pop());
  }
  EXPECT_GE(seen.size(), 4u);
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

TEST(SafetyGate, NoRandomSequenceDrivesOutsideRunOrLeavesAFaultByItself) {
  int runs = 0, faults = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    SafetyEnvelope e = narrow();
    e.good_frames = 2.0;
    SafetyGate gate(e);
    double before_duty = 0.0;
    for (std::uint64_t k = 0; k < 150; ++k) {
      const SafetyFacts facts = random_facts(seed + 5000, k);
      const SafetyState before = gate.state();
      const Drive drive = cycle(gate, facts, random_duty(seed + 5000, k));
      ASSERT_EQ(drive.bridge_open, gate.state() != SafetyState::run);
      if (drive.bridge_open) {
        ASSERT_EQ(drive.duty, 0.0);
      } else {
        ASSERT_LE(std::abs(drive.duty), e.duty_limit);
        ASSERT_LE(std::abs(drive.duty - before_duty), 0.0625 + 1e-15);
      }
      if (before == SafetyState::fault && gate.state() != SafetyState::fault) {
        ASSERT_EQ(facts.request, Request::reset);
        ASSERT_EQ(gate.state(), SafetyState::init);
      }
      if (before == SafetyState::limp && gate.state() == SafetyState::armed) {
        ASSERT_EQ(facts.request, Request::reset);
      }
      if (before != SafetyState::run && gate.state() == SafetyState::run) {
        ASSERT_EQ(facts.request, Request::run);
      }
      before_duty = drive.duty;
      runs += gate.state() == SafetyState::run ? 1 : 0;
      faults += gate.state() == SafetyState::fault ? 1 : 0;
    }
  }
  EXPECT_GT(runs, 1000);
  EXPECT_GT(faults, 1000);
}

}  // namespace
}  // namespace mgdd::rig
