// Every seeker with measured limits, and on a plant that does not go everywhere it asks.
#include <gtest/gtest.h>

#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

struct Outcome {
  double mean = 0.0;     // of the estimate over the last half
  double highest = 0.0;  // limited value over the last half
  double over = 0.0;     // share of cycles over the limit there
};

// J is best at +8; the limited quantity is 100 + 2 x, so that a limit of 104 stands at x = 2.
template <class S>
Outcome run(S& seeker, int cycles, double noise_sd, std::uint64_t seed, double shift = 0.0) {
  Outcome out;
  const int half = cycles / 2;
  for (int k = 0; k < cycles; ++k) {
    const auto index = static_cast<std::uint64_t>(k);
    const double x = seeker.ask()[0];
    const double j[] = {quadratic(x - 8.0) + noise_sd * random::normal(seed, 1, index)};
    const double truth = 100.0 + 2.0 * x + shift;
    const double limits[] = {truth + 4.0 * noise_sd * random::normal(seed, 2, index)};
    seeker.tell({j, limits, false});
    if (k < half) continue;
    out.mean += seeker.estimate()[0] / (cycles - half);
    out.highest = std::max(out.highest, truth);
    out.over += (truth > 104.0 ? 1.0 : 0.0) / (cycles - half);
  }
  return out;
}

TEST(Limits, EverySeekerStopsAtTheLimitAndKeepsItsDitherBelow) {
  for (const LimitMethod method : {LimitMethod::switching, LimitMethod::penalty, LimitMethod::barrier}) {
    const Limit limit{"p_max_bar", 104.0, 0.0, method, method == LimitMethod::barrier ? 0.02 : 1.0, 10.0};
    for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 30.0), 0.0, 1, {limit})) {
      const Outcome out = std::visit([&](auto& seeker) { return run(seeker, 4000, 0.0, 1); }, any);
      EXPECT_LT(out.mean, 2.02) << name << ", " << name_of(method);
      EXPECT_GT(out.mean, -2.0) << name << ", " << name_of(method);
      EXPECT_LE(out.highest, 104.8) << name << ", " << name_of(method);
    }
  }
}

TEST(Limits, MarginKeepsNoiseBelowTheLimit) {
  const Limit limit{"p_max_bar", 104.0, 1.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 30.0), 0.25, 1, {limit})) {
    const Outcome out = std::visit([&](auto& seeker) { return run(seeker, 4000, 0.25, 4); }, any);
    EXPECT_LT(out.mean, 2.0) << name;
    EXPECT_GT(out.mean, -4.0) << name;
    EXPECT_LT(out.over, 0.1) << name;
  }
}

TEST(Limits, ALimitThatIsNotReachedChangesNothing) {
  const Limit limit{"p_max_bar", 1000.0};
  const SearchSpace space = space_at(scalar_input(-8.0), 30.0);
  auto with = every_seeker(space, 0.25, 1, {limit}), without = every_seeker(space, 0.25, 1);
  for (std::size_t i = 0; i < with.size(); ++i) {
    if (with[i].first == "golden_section") continue;  // takes more samples where limits are measured
    const auto path = [&](auto& seeker) {
      std::vector<double> out;
      for (int k = 0; k < 300; ++k) {
        const double x = seeker.ask()[0];
        const double j[] = {quadratic(x - 8.0)}, value[] = {100.0 + 2.0 * x};
        seeker.tell({j, std::span<const double>(value).first(seeker.limit_count()), false});
        out.push_back(x);
      }
      return out;
    };
    EXPECT_EQ(std::visit(path, with[i].second), std::visit(path, without[i].second)) << with[i].first;
  }
}

// The limited quantity jumps up by 12: everything above x = -4 is forbidden now, without a word to the seeker.
TEST(Limits, EverySeekerButGoldenSectionComesBackWhenTheEngineDrifts) {
  const Limit limit{"p_max_bar", 104.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 30.0), 0.0, 1, {limit})) {
    if (name == "golden_section") continue;
    std::visit([](auto& seeker) { run(seeker, 3000, 0.0, 1); }, any);
    const Outcome out = std::visit([](auto& seeker) { return run(seeker, 3000, 0.0, 1, 12.0); }, any);
    EXPECT_LT(out.mean, -4.0) << name;
    EXPECT_GT(out.mean, -9.0) << name;
    EXPECT_LE(out.highest, 104.8) << name;
  }
}

TEST(Limits, ASeekerThatStartsOverALimitLeavesIt) {
  const Limit limit{"p_max_bar", 104.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(12.0), 30.0), 0.0, 1, {limit})) {
    const Outcome out = std::visit([](auto& seeker) { return run(seeker, 1600, 0.0, 1); }, any);
    EXPECT_LT(out.mean, 2.02) << name;
    EXPECT_LE(out.highest, 104.8) << name;
  }
}

constexpr double clamp_at = 2.0;

/// One cycle on a plant that clamps to [low, high]; returns what was applied.
template <class S, class F>
Inputs clamped_cycle(S& seeker, F&& j, double low, double high) {
  const Inputs asked = seeker.ask();
  const Inputs applied = asked.cwiseMax(low).cwiseMin(high);
  const double value[] = {j(applied)};
  EXPECT_EQ(seeker.tell({value, {}, false, {applied.data(), static_cast<std::size_t>(applied.size())}}),
            TellStatus::accepted);
  return applied;
}

double peak_at(const Inputs& x, double best) {
  return 0.5 * bend * (x.array() - best).square().sum();
}

// J is best at +8, the plant ends at 2 (and the other way round); the bounds of the seeker are far away.
TEST(ClampedPlant, NoEstimateWindsUpBeyondTheClamp) {
  for (const double side : {1.0, -1.0}) {
    for (const double start : {-9.0, 11.0}) {
      const double low = side > 0.0 ? -25.0 : -clamp_at, high = side > 0.0 ? clamp_at : 25.0;
      for (auto& [name, any] : every_seeker(space_at(scalar_input(side * start), 30.0), 0.25, 1)) {
        SCOPED_TRACE(name + ", side " + std::to_string(side) + ", start " + std::to_string(start));
        std::visit(
            [&](auto& seeker) {
              double furthest = -unlimited, mean = 0.0;
              for (int k = 0; k < 3000; ++k) {
                const double noise = 0.25 * random::normal(3, 1, static_cast<std::uint64_t>(k));
                clamped_cycle(seeker, [&](const Inputs& x) { return peak_at(x, side * 8.0) + noise; }, low, high);
                if (k >= 400) furthest = std::max(furthest, side * seeker.estimate()[0]);
                if (k >= 2000) mean += side * seeker.estimate()[0] / 1000.0;
              }
              EXPECT_LE(furthest, clamp_at + 0.2);
              EXPECT_GT(mean, clamp_at - 2.0);
            },
            any);
      }
    }
  }
}

TEST(ClampedPlant, AClampInOneOfThreeInputsLeavesTheOthersAlone) {
  for (auto& [name, any] : every_seeker(space_at(inputs({-4.0, 3.0, 5.0}), 30.0), 0.0, 1)) {
    SCOPED_TRACE(name);
    std::visit(
        [&](auto& seeker) {
          for (int k = 0; k < 6000; ++k) {
            const Inputs asked = seeker.ask();
            Inputs applied = asked;
            applied[1] = std::min(applied[1], -1.0);
            const double j[] = {0.5 * bend * (applied - inputs({1.0, 6.0, -2.0})).squaredNorm()};
            ASSERT_EQ(seeker.tell({j, {}, false, {applied.data(), 3}}), TellStatus::accepted);
          }
          const double near = name == "spsa_second_order"  ? 1.0
                              : name == "spsa_first_order" ? 0.6
                                                           : 0.4;  // a clamped input tells its Hessian little
          EXPECT_NEAR(seeker.estimate()[0], 1.0, near);
          EXPECT_LE(seeker.estimate()[1], -1.0 + 0.2);
          EXPECT_GT(seeker.estimate()[1], -3.0);
          EXPECT_NEAR(seeker.estimate()[2], -2.0, near);
        },
        any);
  }
}

// Once the plant goes further again, so does the estimate.
TEST(ClampedPlant, TheEstimateGoesOnWhenTheClampIsGone) {
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-6.0), 30.0), 0.25, 1)) {
    if (name == "golden_section" || name.starts_with("spsa")) continue;  // narrow brackets and small gains by then
    SCOPED_TRACE(name);
    std::visit(
        [&](auto& seeker) {
          const auto j = [](const Inputs& x) { return peak_at(x, 8.0); };
          for (int k = 0; k < 1000; ++k)
            clamped_cycle(seeker, j, -25.0, clamp_at);
          for (int k = 0; k < 2000; ++k)
            clamped_cycle(seeker, j, -25.0, 25.0);
          EXPECT_NEAR(seeker.estimate()[0], 8.0, 0.5);
        },
        any);
  }
}

// Both halves of a difference are clamped differently: the slope is that of the applied inputs, exactly.
TEST(ClampedPlant, SlopesOfAStraightLineAreExact) {
  const auto line = [](const Inputs& x) { return 5.0 + 0.75 * x[0]; };
  GradientDescentSettings descent;
  descent.space = space_at(scalar_input(1.5), 30.0);
  descent.curvature = bend;
  GradientDescent by_descent(descent);
  SpsaSettings spsa;
  spsa.space = descent.space;
  spsa.curvature = bend;
  Spsa by_spsa(spsa);
  for (int k = 0; k < 3; ++k) {  // one of them to see that the plant goes no further
    clamped_cycle(by_descent, line, -30.0, clamp_at);
    clamped_cycle(by_spsa, line, -30.0, clamp_at);
  }
  EXPECT_NEAR(by_descent.gradient()[0], 0.75, 1e-12);
  EXPECT_NEAR(by_spsa.gradient()[0], 0.75, 1e-12);
  ExtremumSeekingSettings batch;
  batch.space = descent.space;
  batch.curvature = bend;
  ExtremumSeeking by_batch(batch);
  for (int k = 0; k < 10; ++k)
    clamped_cycle(by_batch, line, -30.0, clamp_at);
  EXPECT_NEAR(by_batch.gradient()[0], 0.75, 1e-12);
}

TEST(ClampedPlant, LimitsAreLearntFromTheAppliedInput) {
  const Limit limit{"p_max_bar", 300.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-9.0), 30.0), 0.0, 1, {limit})) {
    SCOPED_TRACE(name);
    std::visit(
        [&](auto& seeker) {
          double mean = 0.0;
          for (int k = 0; k < 1000; ++k) {
            const double applied = seeker.ask()[0] - 4.0;  // an actuator with an offset
            const double j[] = {quadratic(applied - 3.0)}, value[] = {100.0 + 2.0 * applied};
            seeker.tell({j, value, false, {&applied, 1}});
          }
          const StateColumns state = save_state(seeker);
          mean = state.at("limit0_mean")[0];
          EXPECT_NEAR(mean, 100.0 + 2.0 * state.at("limit0_mean_input")[0], 1e-9);
        },
        any);
  }
}

}  // namespace
}  // namespace mgdd::optimize
