// A compiled function as a plant: what it is called with, what counts as failed, and the loop that one would write.
#include "mgdd/loop/function_plant.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "mgdd/loop/run_loop.hpp"
#include "mgdd/optimize/ask_tell/seeker_history.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::loop {
namespace {

using optimize::scalar_input;

struct Hill {
  double bend, best;
};

/// J = 50 - bend (x - best)^2, with a limit 2 x; status 3 above 5.
// NOLINTNEXTLINE(misc-const-correctness): the signature of a plant
int hill(const double* inputs, std::size_t n_inputs, double* outputs, std::size_t n_outputs, void* user_data) {
  const Hill& h = *static_cast<const Hill*>(user_data);
  outputs[0] = 50.0 - h.bend * (inputs[0] - h.best) * (inputs[0] - h.best);
  if (n_outputs > 1) outputs[1] = 2.0 * inputs[n_inputs - 1];
  return inputs[0] > 5.0 ? 3 : 0;
}

/// Gives back what it was asked for: NaN, infinity, overload, or nothing at all at 0.
int echo(const double* inputs, std::size_t, double* outputs, std::size_t, void*) {
  if (inputs[0] != 0.0) outputs[0] = inputs[0];
  return 0;
}

Hill& of_the_tests() {
  static Hill h{0.03, -4.0};
  return h;
}

optimize::Spsa drawing() {
  optimize::SpsaSettings s;
  s.space = {scalar_input(-12.0), scalar_input(-30.0), scalar_input(10.0)};
  return optimize::Spsa(s);
}

TEST(FunctionPlant, GivesInputsAndDataAndTakesJAndLimits) {
  FunctionPlant plant(&hill, &of_the_tests(), {.inputs = 2, .limits = {"q"}});
  const std::array<double, 2> inputs{-2.0, 7.0};
  const BenchCycle c = plant.step(inputs);
  EXPECT_EQ(c.j, 50.0 - 0.03 * 4.0);
  ASSERT_EQ(c.limits().size(), 1u);
  EXPECT_EQ(c.limits()[0], 14.0);
  EXPECT_FALSE(c.misfire);
  EXPECT_EQ(plant.cycle(), 1);
}

TEST(FunctionPlant, AStatusOrAnOutputThatIsNoReadingIsAFailedCycle) {
  FunctionPlant fails(&hill, &of_the_tests(), {.limits = {"q"}});
  const double above = 6.0;
  const BenchCycle c = fails.step({&above, 1});
  EXPECT_TRUE(c.misfire);
  EXPECT_TRUE(std::isnan(c.j));
  EXPECT_TRUE(std::isnan(c.limits()[0]));
  FunctionPlant plant(&echo, nullptr, {});
  for (const double x : {0.0, std::nan(""), std::numeric_limits<double>::infinity(), -1.1e30})
    EXPECT_TRUE(plant.step({&x, 1}).misfire) << x;
  const double good = 1.0;
  EXPECT_EQ(plant.step({&good, 1}).j, 1.0);  // after a bad cycle too
}

TEST(FunctionPlant, NoiseIsOfSeedAndCycle) {
  FunctionPlant plant(&hill, &of_the_tests(), {.noise_sd = 0.5, .seed = 9});
  const double at = -4.0;
  for (const std::int64_t cycle : {0, 1, 2})
    EXPECT_EQ(plant.step({&at, 1}).j, 50.0 + 0.5 * plant_noise(9, cycle));
  plant.reset(4);
  EXPECT_EQ(plant.step({&at, 1}).j, 50.0 + 0.5 * plant_noise(4, 0));
  EXPECT_NE(plant_noise(9, 0), plant_noise(4, 0));
}

TEST(FunctionPlant, AStepAllocatesNothing) {
  FunctionPlant plant(&hill, &of_the_tests(), {.noise_sd = 0.5});
  optimize::Spsa seeker = drawing();
  static_assert(noexcept(loop_step(plant, seeker)));
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 100; ++k)
    loop_step(plant, seeker);
  EXPECT_EQ(counter.count(), 0u);
}

TEST(FunctionPlant, ARunStandsInTheHistoryOfTheSeeker) {
  FunctionPlant plant(&hill, &of_the_tests(), {});
  optimize::RecordedSeeker recorded(drawing());
  EXPECT_EQ(run_loop(plant, recorded, 40), 40);
  EXPECT_EQ(recorded.history().size(), 40u);
  const std::stop_source source;
  source.request_stop();
  EXPECT_EQ(run_loop(plant, recorded, 40, source.get_token()), 0);
  EXPECT_THROW(run_loop(plant, recorded, 0), ParameterError);
  EXPECT_EQ(plant.cycle(), 40);
}

TEST(FunctionPlant, WhatDoesNotFitIsRefused) {
  EXPECT_THROW(FunctionPlant(nullptr, nullptr, {}), ParameterError);
  EXPECT_THROW(FunctionPlant(&echo, nullptr, {.inputs = 9}), ParameterError);
  EXPECT_THROW(FunctionPlant(&echo, nullptr, {.values = 0}), ParameterError);
  EXPECT_THROW(FunctionPlant(&echo, nullptr, {.noise_sd = std::nan("")}), ParameterError);
  EXPECT_THROW(FunctionPlant(&echo, nullptr, {.limits = std::vector<std::string>(9, "q")}), ParameterError);
  EXPECT_THROW(require_match(FunctionPlant(&echo, nullptr, {.inputs = 2}), drawing()), ParameterError);
  EXPECT_THROW(require_match(FunctionPlant(&echo, nullptr, {.limits = {"q"}}), drawing()), ParameterError);
}

}  // namespace
}  // namespace mgdd::loop
