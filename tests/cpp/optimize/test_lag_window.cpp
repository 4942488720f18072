// A lag taken out of readings: exact without noise, and with it better than the lag inverted cycle by cycle.
#include "mgdd/optimize/watch/lag_window.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "mgdd/common/random.hpp"

namespace mgdd::optimize {
namespace {

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
