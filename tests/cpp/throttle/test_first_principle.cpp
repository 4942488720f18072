// The first-principle groups: the run of the plant that they stand for, terminal speeds by hand, delay, refusals.
#include "mgdd/throttle/models/first_principle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "mgdd/common/error.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;
using test_support::Signal;

FirstPrinciple options_of(const Throttle& t) {
  FirstPrinciple options;
  options.closed_deg = t.closed_deg;
  options.open_deg = t.open_deg;
  options.ramp_deg = t.preload_ramp_deg;
  options.substeps = 10;
  return options;
}

Signal run(const FirstPrinciple& options, const dynamics::Values<double, 9>& groups, const Signal& duty,
           double angle_deg) {
  Signal out(duty.size());
  const auto model = options.prepare<double>(groups, 1e-3);
  auto state = model.at_rest(angle_deg);
  dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(out));
  return out;
}

// The groups hold everything but the dead band, the air and a viscous share of the damping under inductance; the step
// of the plant is implicit in the ramp of the preload, theirs is not, so that only runs beside it are the same.
TEST(FirstPrinciple, RunsAsThePlantDoesOnEitherSideOfLimpHome) {
  for (const bool inductance : {false, true}) {
    for (const bool above : {false, true}) {
      Throttle t = asymmetric_throttle();
      t.limp_home_deg = 45.0;
      t.dead_band = t.pressure_drop_kpa = 0.0;
      (inductance ? t.viscous_nms_per_rad : t.inductance_mh) = 0.0;
      const Signal duty = test_support::chirp(above ? 0.17 : -0.155, 0.14, 2.0, 6.0, 2.0);
      const double start_deg = above ? 65.0 : 25.0;
      Signal plant(duty.size());
      ThrottleState state = at_rest(start_deg);
      simulate(ThrottlePlant(t), {.duty = duty}, 10, state, {.angle_deg = plant});
      const auto groups = first_principle_of(t);
      EXPECT_NEAR(groups[8], inductance ? 1.1e-3 / (1.7 + 0.22) : 0.0, 1e-15);
      const Signal model = run(options_of(t), groups, duty, start_deg);
      double worst = 0.0;
      for (std::size_t k = 0; k < duty.size(); ++k)
        worst = std::max(worst, std::abs(plant[k] - model[k]));
      EXPECT_LT(worst, 1e-6) << inductance << above;
      const auto [low, high] = std::ranges::minmax(plant);
      EXPECT_GT(low, above ? 45.4 : 1.5) << inductance;
      EXPECT_LT(high, above ? 86.0 : 44.6) << inductance;
      EXPECT_GT(high - low, 4.0);
    }
  }
}

// Without springs a held duty u ends in the speed w with w/(tau G) + friction(w) = u, for any step and inductance.
TEST(FirstPrinciple, ReachesTheTerminalSpeedOfItsForces) {
  FirstPrinciple options;
  options.closed_deg = -180.0;
  options.open_deg = 180.0;
  const double tau = 0.02, gain = 5e3, delta = 0.06;
  const dynamics::Values<double, 9> groups{tau, gain, 0.0, 0.0, delta, 0.0, 0.0, 8.0, 0.004};
  for (const double duty : {0.5, -0.3}) {
    for (const Friction friction : {Friction::coulomb, Friction::tanh}) {
      options.friction = friction;
      options.tanh_deg_per_s = 17.0;
      const auto model = options.prepare<double>(groups, 1e-3);
      auto state = model.at_rest(duty > 0.0 ? -100.0 : 100.0);
      for (int k = 0; k < 1500; ++k)
        model.step(state, duty);
      const double w = state.speed_deg_per_s;
      const double level = delta * (friction == Friction::tanh ? std::tanh(w / 17.0) : std::copysign(1.0, duty));
      EXPECT_NEAR(w / (tau * gain) + level, duty, 1e-9);
      EXPECT_NEAR(state.torque, level, 1e-9) << "the motor carries the friction alone";
      EXPECT_GT(w * duty, 0.0);
      ASSERT_LT(std::abs(state.angle_deg), 180.0);
    }
  }
}

TEST(FirstPrinciple, AnswersADelayedDutyLater) {
  const Throttle t = asymmetric_throttle();
  FirstPrinciple options = options_of(t);
  const Signal duty = test_support::chirp(0.04, 0.23, 0.5, 5.0, 1.0);
  const Signal prompt = run(options, first_principle_of(t), duty, 11.0);
  options.delay_samples = 3.0;
  const Signal late = run(options, first_principle_of(t), duty, 11.0);
  for (std::size_t k = 3; k < duty.size(); ++k)
    ASSERT_NEAR(late[k], prompt[k - 3], 1e-12) << k;
  EXPECT_GT(std::abs(prompt.back() - prompt[prompt.size() - 4]), 0.1);
}

// A bias b is what the duty lacks: the run under u with b is that under u - b.
TEST(FirstPrinciple, ABiasActsAsLessDuty) {
  const Throttle t = asymmetric_throttle();
  const auto model = options_of(t).prepare<double>(first_principle_of(t), 1e-3);
  auto biased = model.at_rest(25.0), plain = biased;
  biased.bias_duty = 0.07;
  for (int k = 0; k < 300; ++k) {
    model.step(biased, 0.37);
    model.step(plain, 0.30);
  }
  EXPECT_NEAR(model.output(biased), model.output(plain), 1e-9);
  EXPECT_GT(std::abs(model.output(plain) - 25.0), 1.0);
}

TEST(FirstPrinciple, RefusesOptionsByName) {
  EXPECT_NO_THROW(FirstPrinciple{}.validate());
  const auto refused = [](const std::function<void(FirstPrinciple&)>& change, std::string_view part) {
    FirstPrinciple options;
    change(options);
    try {
      options.validate();
      ADD_FAILURE() << part;
    } catch (const ParameterError& error) {
      EXPECT_EQ(std::string_view(error.what()).find(part), 0U) << error.what();
    }
  };
  refused([](FirstPrinciple& o) { o.closed_deg = -181.0; }, "closed_deg = -181");
  refused([](FirstPrinciple& o) { o.open_deg = 0.5; }, "open_deg = 0.5");
  refused([](FirstPrinciple& o) { o.ramp_deg = 0.0; }, "ramp_deg = 0");
  refused([](FirstPrinciple& o) { o.substeps = 0; }, "substeps = 0");
  refused([](FirstPrinciple& o) { o.delay_samples = 5.5; }, "delay_samples = 5.5");
  refused([](FirstPrinciple& o) { o.tanh_deg_per_s = -1.0; }, "tanh_deg_per_s = -1");
  refused([](FirstPrinciple& o) { o.friction = Friction::stribeck; }, "friction = 'stribeck'");
}

}  // namespace
}  // namespace mgdd::throttle
