// The first-principle groups: the run of the plant that they stand for, terminal speeds, delay, friction, gap,
// refusals.
#include "mgdd/throttle/models/first_principle.hpp"

#include <span>
#include <string_view>

#include "mgdd/common/error.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/simulation.hpp"
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

Signal run(const FirstPrinciple& options, const Groups& groups, const Signal& duty, double angle_deg) {
  Signal out(duty.size());
  const auto model = options.prepare<double>(groups, 1e-3);
  auto state = model.at_rest(angle_deg);
  dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(out));
  return out;
}

// The groups hold everything but the dead band and the air. Plant and groups round a step in different ways, so that
// they meet as the steps become fine.
TEST(FirstPrinciple, RunsAsThePlantDoesOnEitherSideOfLimpHome) {
  for (const bool inductance : {false, true}) {
    for (const bool above : {false, true}) {
      Throttle t = asymmetric_throttle();
      t.limp_home_deg = 45.0;
      t.dead_band = t.pressure_drop_kpa = 0.0;
      if (!inductance) t.inductance_mh = 0.0;
      const Signal duty = test_support::chirp(above ? 0.17 : -0.155, 0.14, 2.0, 6.0, 2.0);
      const double start_deg = above ? 65.0 : 25.0;
      const auto groups = first_principle_of(t);
      EXPECT_NEAR(groups[lag], inductance ? 1.1e-3 / (1.7 + 0.22) : 0.0, 1e-15);
      Signal plant(duty.size());
      const auto worst = [&](int substeps) {
        ThrottleState state = at_rest(start_deg);
        simulate(ThrottlePlant(t, 1e-3 / substeps), {.duty = duty}, substeps, state, {.angle_deg = plant});
        FirstPrinciple options = options_of(t);
        options.substeps = substeps;
        const Signal model = run(options, groups, duty, start_deg);
        double most = 0.0;
        for (std::size_t k = 0; k < duty.size(); ++k)
          most = std::max(most, std::abs(plant[k] - model[k]));
        return most;
      };
      const double coarse = worst(25), fine = worst(100);
      EXPECT_LT(fine, 6e-3) << inductance << above;
      EXPECT_LT(fine, 0.35 * coarse) << inductance << above;
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
  const double tau_s = 0.02, g = 5e3, friction_duty = 0.06;
  const Groups groups{tau_s, g, 0.0, 0.0, friction_duty, 0.0, 0.0, 8.0, 0.004, 0.0, 10.0, 0.25, 0.0, 0.0, 0.5, 0.0};
  for (const double duty : {0.5, -0.3}) {
    for (const Friction friction : {Friction::coulomb, Friction::tanh}) {
      options.friction = friction;
      options.tanh_deg_per_s = 17.0;
      const auto model = options.prepare<double>(groups, 1e-3);
      auto state = model.at_rest(duty > 0.0 ? -100.0 : 100.0);
      for (int k = 0; k < 1500; ++k)
        model.step(state, duty);
      const double w = state.speed_deg_per_s;
      const double level =
          friction_duty * (friction == Friction::tanh ? std::tanh(w / 17.0) : std::copysign(1.0, duty));
      EXPECT_NEAR(w / (tau_s * g) + level, duty, 1e-9);
      EXPECT_NEAR(state.torque, level, 1e-9) << "the motor carries the friction alone";
      EXPECT_GT(w * duty, 0.0);
      ASSERT_LT(std::abs(state.angle_deg), 180.0);
    }
  }
}

TEST(FirstPrinciple, AnswersADelayedDutyLater) {
  const Throttle t = asymmetric_throttle();
  const FirstPrinciple options = options_of(t);
  const Signal duty = test_support::chirp(0.04, 0.23, 0.5, 5.0, 1.0);
  const Signal prompt = run(options, first_principle_of(t), duty, 11.0);
  Groups later = first_principle_of(t);
  later[delay] = 3.0;
  const Signal late = run(options, later, duty, 11.0);
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

// Between two held duties the torque of a small step is that of their mean.
TEST(FirstPrinciple, ADelayBetweenTwoSamplesIsTheMeanOfBoth) {
  Groups groups = first_principle_of(asymmetric_throttle());
  groups[delta] = 0.0;  // what is left is linear far above limp-home
  const FirstPrinciple options = options_of(asymmetric_throttle());
  Signal duty(60, 0.2);
  std::fill(duty.begin() + 5, duty.end(), 0.203);
  const auto with_delay = [&](double samples) {
    groups[delay] = samples;
    Signal out(duty.size());
    const auto model = options.prepare<double>(groups, 1e-3);
    auto state = model.at_rest(50.0, 0.2);
    dynamics::simulate(model, state, std::span<const double>(duty), std::span<double>(out));
    return out;
  };
  const Signal one = with_delay(1.0), two = with_delay(2.0), between = with_delay(1.5);
  EXPECT_GT(std::abs(one.back() - two.back()), 1e-3);
  for (std::size_t k = 0; k < duty.size(); ++k)
    ASSERT_NEAR(between[k], 0.5 * (one[k] + two[k]), 1e-11) << k;
}

// A stop yields by what presses on it over its stiffness, stores what it gives back, and never pulls.
TEST(FirstPrinciple, AStopThatYieldsGivesByItsStiffnessAndNeverPulls) {
  const Groups groups{0.05, 6e4,  0.04, 0.0, 0.01, 0.07, 0.0, 8.0,  1e-3, 0.0,
                      10.0, 0.25, 0.0,  0.0, 0.5,  0.0,  0.3, 25.0, 0.2};
  for (const int substeps : {2, 8, 40}) {
    FirstPrinciple options;
    options.open_deg = 30.0;
    options.substeps = substeps;
    const auto model = options.prepare<double>(groups, 1e-3);
    for (const bool up : {true, false}) {
      auto state = model.at_rest(up ? 20.0 : 5.0);
      const double duty = up ? 0.31 : -0.27, end = up ? 30.0 : 0.0, preload = up ? 0.04 : -0.07;
      double beyond = 0.0, back = 0.0, arrived = 0.0;
      for (int k = 0; k < 2000; ++k) {
        const double before = state.speed_deg_per_s;
        model.step(state, duty);
        const double depth = (state.angle_deg - end) * (up ? 1.0 : -1.0);
        if (depth > 0.0 && arrived == 0.0) arrived = std::abs(before);
        beyond = std::max(beyond, depth);
        back = std::max(back, up ? -state.speed_deg_per_s : state.speed_deg_per_s);
      }
      const double rest = (state.angle_deg - end) * 25.0;
      EXPECT_NEAR(rest, duty - preload, 0.01 + 1e-9) << "within friction";
      EXPECT_EQ(state.speed_deg_per_s, 0.0);
      EXPECT_GT(beyond, 2.0 * std::abs(rest) / 25.0) << "it arrives with speed";
      EXPECT_GT(back, 0.05 * arrived) << "and rebounds";
      EXPECT_LT(back, 0.9 * arrived);
      for (int k = 0; k < 30; ++k) {
        model.step(state, 0.0);
        EXPECT_LT((state.angle_deg - end) * (up ? 1.0 : -1.0), beyond);
      }
      EXPECT_GT(std::abs(state.angle_deg - end), 0.5) << "the spring takes it away";
    }
  }
}

// Every number, with and without presliding and gap, against central differences.
TEST(FirstPrinciple, SlopesToEveryGroupAreThoseOfDifferences) {
  for (const double presliding : {0.0, 0.12}) {
    const Groups at{0.021, 9e4,  0.11, 7e-4,       0.05, 0.14,       1.3e-3, 9.0,  8e-4, 0.3,
                    22.0,  0.31, 1.4,  presliding, 0.6,  presliding, 0.35,   31.0, 0.4};
    FirstPrinciple options;
    options.substeps = 4;
    options.closed_deg = 6.5;
    const auto angle = [&]<class T>(const FirstPrinciple::Groups<T>& groups) {
      const auto model = options.prepare<T>(groups, 1e-3);
      auto state = model.at_rest(T(12.0));
      std::array<T, 90> out{};
      for (std::size_t k = 0; k < out.size(); ++k) {
        out[k] = model.output(state);
        model.step(state, T(k < 40 ? -0.34 : 0.41));
      }
      return out;
    };
    using D = Dual<FirstPrinciple::n_parameters>;
    FirstPrinciple::Groups<D> seeded;
    for (std::size_t i = 0; i < at.size(); ++i)
      seeded[i] = D::seeded(at[i], static_cast<int>(i));
    const auto exact = angle(seeded);
    EXPECT_LT(std::ranges::min(exact, {}, &D::value).value, 8.0) << "both sides are visited";
    for (std::size_t i = 0; i < at.size(); ++i) {
      if (presliding == 0.0 && i >= bend && i <= half_gap) continue;
      Groups up = at, down = at;
      const double h = 1e-6 * at[i];
      up[i] += h;
      down[i] -= h;
      const auto high = angle(up), low = angle(down);
      double most = 0.0;
      for (std::size_t k = 0; k < exact.size(); ++k) {
        const double expected = (high[k] - low[k]) / (2.0 * h);
        ASSERT_NEAR(exact[k].grad[i], expected, 1e-4 * (std::abs(expected) + 0.02 / at[i]))
            << FirstPrinciple::parameters[i].name << " at " << k << ", presliding " << presliding;
        most = std::max(most, std::abs(expected * at[i]));
      }
      EXPECT_GT(most, 3e-4) << FirstPrinciple::parameters[i].name;
    }
  }
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
  refused([](FirstPrinciple& o) { o.substeps = 0; }, "substeps = 0");
  refused([](FirstPrinciple& o) { o.tanh_deg_per_s = -1.0; }, "tanh_deg_per_s = -1");
  refused([](FirstPrinciple& o) { o.friction = Friction::stribeck; }, "friction = 'stribeck'");
}

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
