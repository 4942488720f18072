// Readings that come late, and the window that a lag leaves of them.
#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/watch/lag_window.hpp"
#include "support/coupled_map.hpp"
#include "support/seeker_case.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

// Told three cycles short or long, the delay is read off the readings; told right, it stays.
TEST(LateReadings, TellADelayThatIsToldWrong) {
  constexpr int seeds = 8;
  for (const double told : {5.0, 8.0, 11.0}) {
    int found = 0;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
      auto s = two_inputs(seed);
      s.sensor = {told, 0.0};
      GaussianProcessSeeking seeker(s);
      std::vector<double> on_their_way(8, -lost(s.space.start));
      for (int k = 0; k < 200; ++k) {
        on_their_way.push_back(-lost(seeker.ask()) + noise(seed, k));
        const double j[] = {on_their_way[static_cast<std::size_t>(k)]};
        seeker.tell({j, {}});
      }
      found += seeker.delay_cycles() == 8.0 && lost(seeker.estimate()) < 0.3 ? 1 : 0;
    }
    EXPECT_GE(found, seeds - 2) << told;
  }
}

// What is on its way is counted on: nothing is tried twelve times before its first reading comes.
TEST(LateReadings, AreWaitedForByTheProcess) {
  double asked_far = 0.0, late = 0.0;
  constexpr int seeds = 10;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    auto s = two_inputs(seed);
    s.components = {{20.0, 0.0}};
    s.delay_uncertainty = 0;
    GaussianProcessSeeking seeker(s);
    std::vector<double> on_their_way(20, -lost(s.space.start));
    for (int k = 0; k < 200; ++k) {
      on_their_way.push_back(-lost(seeker.ask()) + noise(seed, k));
      asked_far += lost(seeker.ask()) / (200 * seeds);
      const double j[] = {on_their_way[static_cast<std::size_t>(k)]};
      seeker.tell({j, {}});
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LT(late, 0.15);
  EXPECT_LT(asked_far, 3.2);  // the start itself loses 9.6
}

// J at the estimate lies within 1.44 standard deviations of what is expected, from the first readings on.
TEST(LateReadings, OfTheProcessHoldItsIntervals) {
  double held = 0.0, stated = 0.0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto s = two_inputs(seed);
    s.sensor = {20.0, 10.0};
    GaussianProcessSeeking seeker(s);
    std::vector<double> on_their_way(20, -lost(s.space.start));
    double lagged = on_their_way[0];
    for (int k = 0; k < 260; ++k) {
      on_their_way.push_back(-lost(seeker.ask()));
      if (seeker.expected_sd() > 0.0) {
        stated += 1.0;
        held += std::abs(-lost(seeker.estimate()) - seeker.expected()) < 1.44 * seeker.expected_sd() ? 1.0 : 0.0;
      }
      lagged += (1.0 - std::exp(-0.1)) * (on_their_way[static_cast<std::size_t>(k)] - lagged);
      const double j[] = {lagged + noise(seed, k)};
      seeker.tell({j, {}});
    }
  }
  EXPECT_GT(stated, 20 * 180.0);
  EXPECT_GE(held / stated, 0.85);
}

// y += (1 - exp(-1/3)) (x - y): an input is held for 3 cycles, and the lag is taken out of what is read meanwhile.
TEST(LateReadings, BehindALagHoldTheInputs) {
  auto s = two_inputs(4);
  s.sensor = {0.0, 3.0};
  GaussianProcessSeeking seeker(s);
  double lagged = -lost(s.space.start);
  int changes = 0;
  Inputs before = s.space.start;
  for (int k = 0; k < 280; ++k) {
    const Inputs x = seeker.ask();
    changes += x == before ? 0 : 1;
    before = x;
    lagged += (1.0 - std::exp(-1.0 / 3.0)) * (-lost(x) - lagged);
    const double j[] = {lagged + noise(4, k, 0.05)};
    seeker.tell({j, {}});
  }
  EXPECT_LE(changes, 94);
  EXPECT_LT(lost(seeker.estimate()), 0.2);
}

// Behind a delay the dither goes on where a reading is missing: what is on its way stays with its input.
TEST(LateReadings, ThatAreMissingCostTheDitherLittle) {
  for (const MeanRemoval form : {MeanRemoval::batch, MeanRemoval::moving_average}) {
    double lost[2] = {0.0, 0.0};
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      for (const int some : {0, 1}) {
        ExtremumSeekingSettings s = plain_seeking(7.0);
        s.form = form;
        s.dither.period = 12;
        s.components = {{7.0, 0.0}};
        ExtremumSeeking seeker(s);
        std::vector<double> on_their_way(7, quadratic(7.0));
        for (int k = 0; k < 600; ++k) {
          const auto at = static_cast<std::uint64_t>(k);
          on_their_way.push_back(quadratic(seeker.ask()[0]) + 0.1 * random::normal(seed, 7, at));
          lost[some] -= quadratic(seeker.estimate()[0]) / 24000.0;
          const double j[] = {on_their_way[at]};
          seeker.tell({j, {}, some == 1 && random::bernoulli(0.1, seed, 8, at)});
        }
      }
    }
    EXPECT_LT(lost[1], 1.1 * lost[0]) << name_of(form);
  }
}

constexpr double lag = 10.0;
constexpr int hold = 7, windows = 2000;

/// A quantity that is another one in every window, noisy before the sensor, after it, or not at all.
struct Plant {
  double before = 0.0, after = 0.0;
  double quantity = 0.0, sensor = 0.0;

  double read(int cycle) {
    const auto at = static_cast<std::uint64_t>(cycle);
    if (cycle % hold == 0) quantity = 40.0 + 3.0 * random::normal(1, 1, at);
    sensor += (1.0 - std::exp(-1.0 / lag)) * (quantity + before * random::normal(1, 2, at) - sensor);
    return sensor + after * random::normal(1, 3, at);
  }
};

struct Errors {
  double ours, inverted;  // root mean squares
  int windows = 0;
};

Errors errors_of(Plant plant) {
  LagWindow window(lag, 1);
  const double keep = std::exp(-1.0 / lag);
  Errors out{0.0, 0.0};
  double last = 0.0, inverted = 0.0;
  for (int k = 0; k < hold * windows; ++k) {
    double value = plant.read(k);
    inverted += (value - keep * last) / (1.0 - keep) / hold;
    last = value;
    const int number = k / hold;
    Inputs z = scalar_input(number);
    const bool full = window.take(value, z, hold);
    EXPECT_TRUE(k < 2 * hold || full == ((k + 1) % hold == 0)) << k;
    if ((k + 1) % hold != 0) continue;
    if (k >= 2 * hold) {  // the first reading only says where the sensor is
      EXPECT_DOUBLE_EQ(z[0], number);
      out.ours += (value - plant.quantity) * (value - plant.quantity);
      out.inverted += (inverted - plant.quantity) * (inverted - plant.quantity);
      ++out.windows;
    }
    inverted = 0.0;
  }
  out.ours = std::sqrt(out.ours / out.windows);
  out.inverted = std::sqrt(out.inverted / out.windows);
  return out;
}

TEST(LagWindow, IsExactWithoutNoise) {
  EXPECT_LT(errors_of({0.0, 0.0}).ours, 1e-5);
}

TEST(LagWindow, HearsLessNoiseThanTheInvertedLag) {
  const Errors late = errors_of({0.0, 0.3}), both = errors_of({0.3, 0.3}), early = errors_of({0.3, 0.0});
  EXPECT_LT(late.ours, 0.7 * late.inverted);
  EXPECT_LT(both.ours, 0.72 * both.inverted);
  EXPECT_LT(early.ours, 1.1 * early.inverted);  // of which the inverted lag makes the plain mean
}

TEST(LagWindow, WhatWasNotReadSaysNothing) {
  LagWindow window(lag, 1);
  Plant plant{0.0, 0.0};
  for (int k = 0; k < 40 * hold; ++k) {
    double value = plant.read(k);
    if (k % hold == 2) {
      window.skip();
      plant.sensor -= 30.0;  // what a failed cycle did to the sensor, nobody knows
      continue;
    }
    const int number = k / hold;
    Inputs z = scalar_input(number);
    if (window.take(value, z, hold - 2) && k >= 2 * hold) {
      EXPECT_NEAR(value, plant.quantity, 1e-5) << k;
    }
  }
}

}  // namespace
}  // namespace mgdd::optimize
