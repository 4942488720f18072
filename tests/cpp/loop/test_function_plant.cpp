// A compiled function as a plant allocates nothing in its loop; what it is called with is tested from Python.
#include "mgdd/loop/function_plant.hpp"

#include <gtest/gtest.h>

#include "mgdd/loop/engine_loop.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::loop {
namespace {

int hill(const double* inputs, std::size_t, double* outputs, std::size_t, void*) {
  outputs[0] = 50.0 - 0.03 * (inputs[0] + 4.0) * (inputs[0] + 4.0);
  return inputs[0] > 5.0 ? 3 : 0;
}

TEST(FunctionPlant, AStepAllocatesNothing) {
  FunctionPlant plant(&hill, nullptr, {.noise_sd = 0.5});
  optimize::SpsaSettings s;
  s.space = {optimize::scalar_input(-12.0), optimize::scalar_input(-30.0), optimize::scalar_input(10.0)};
  optimize::Spsa seeker(s);
  static_assert(noexcept(loop_step(plant, seeker)));
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 100; ++k)
    loop_step(plant, seeker);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::loop
