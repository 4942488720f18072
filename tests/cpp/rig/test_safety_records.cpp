// Envelope, audit list and refused states of the safety gate.
#include <string>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/safety_samples.hpp"

namespace mgdd::rig {
namespace {

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
