// The supervisor on the virtual throttle: silent and without effect on healthy plants that it knows to 20 % only.
#include <gtest/gtest.h>

#include "mgdd/common/enum_names.hpp"
#include "support/supervised_throttle.hpp"

namespace mgdd::loop {
namespace {

using namespace test_support;
using control::Pid;
using control::SlidingMode;
using control::SupervisorMode;

template <class Look>
void with_both_controllers(const TunedSet& tuned, Look look) {
  const control::Plate known = plate_of(preset(tuned.preset));
  look(Pid(pid_of(known, tuned.pid)));
  look(SlidingMode(sliding_mode_of(known, tuned.sliding, ReachingLaw::boundary_layer)));
}

TEST(ThrottleSupervisorLoop, NoFalseAlarmOnAHundredPlantsOfEachPresetWithNoiseAndAir) {
  for (const TunedSet& tuned : tuned_sets) {
    const Throttle nominal = preset(tuned.preset);
    with_both_controllers(tuned, [&](const auto& controller) {
      for (std::uint64_t body = 0; body < 100; ++body) {
        SupervisedLoop loop(controller, supervisor_of(nominal), plant_of(near(nominal, body), 10.0, body));
        Air air(body);
        for (int k = 0; k < driving_samples; ++k) {
          const control::SupervisorOrder order = loop.step(driving_deg(k), air.torque_nm(k)).order;
          ASSERT_EQ(order.mode, SupervisorMode::normal)
              << 'P' << tuned.preset << " body " << body << " sample " << k << ": " << name_of(order.reason);
        }
      }
    });
  }
}

}  // namespace
}  // namespace mgdd::loop
