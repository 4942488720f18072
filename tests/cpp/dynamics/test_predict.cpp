// A horizon under moves: its slopes against differences, nothing allocated.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mgdd/dynamics/predict.hpp"
#include "mgdd/throttle/models/first_principle.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/plant.hpp"
#include "support/no_alloc.hpp"
#include "support/respond.hpp"

namespace mgdd::dynamics {
namespace {

using throttle::FirstPrinciple;
using throttle::PwR;

constexpr std::size_t horizon = 20;
const std::array<double, 3> moves{0.42, 0.21, 0.3};
const std::array<int, 3> lengths{4, 6, 10};

template <class M>
std::vector<double> angles(const M& model, const typename M::State& state, const std::array<double, 3>& u) {
  std::vector<double> held;
  for (std::size_t m = 0; m < 3; ++m)
    held.insert(held.end(), static_cast<std::size_t>(lengths[m]), u[m]);
  return test_support::respond(model, state, held);
}

template <class M>
void expect_exact(const M& model, const typename M::State& state) {
  std::array<double, horizon> y{};
  std::array<std::array<double, 3>, horizon> slope{};
  const test_support::AllocationCounter counter;
  predict<3>(model, state, moves, lengths, y, slope);
  EXPECT_EQ(counter.count(), 0U);
  static_assert(noexcept(predict<3>(model, state, moves, lengths, y, slope)));
  const auto plain = angles(model, state, moves);
  for (std::size_t k = 0; k < horizon; ++k)
    ASSERT_NEAR(y[k], plain[k], 1e-10);
  for (std::size_t d = 0; d < 3; ++d) {
    auto up = moves, down = moves;
    up[d] += 1e-6;
    down[d] -= 1e-6;
    const auto high = angles(model, state, up), low = angles(model, state, down);
    for (std::size_t k = 0; k < horizon; ++k) {
      const double expected = (high[k] - low[k]) / 2e-6;
      ASSERT_NEAR(slope[k][d], expected, 1e-5 * (1.0 + std::abs(expected))) << d << " at " << k;
    }
  }
}

template <class M>
typename M::State moving(const M& model) {
  typename M::State state{};
  if constexpr (requires { model.model; }) {
    state = model.model.at_rest(25.0);
  } else {
    state = model.at_rest(25.0);
  }
  for (int k = 0; k < 15; ++k)
    model.step(state, input_of(model, 0.45));
  return state;
}

TEST(Predict, SlopesToMovesAreExact) {
  for (const double delay : {0.0, 1.5}) {
    PwR p;
    p.frame.sample_s = 2e-3;
    p.frame.delay_samples = delay;
    const throttle::PwRModel pw_r(p);
    expect_exact(pw_r, moving(pw_r));
    auto groups = throttle::first_principle_of(throttle::Throttle{});
    groups[12] = delay;
    const auto model = FirstPrinciple{}.prepare<double>(groups, 2e-3);
    expect_exact(model, moving(model));
  }
  const Repeated<throttle::ThrottlePlant> plant{throttle::ThrottlePlant{throttle::Throttle{}}, 20};
  expect_exact(plant, moving(plant));
}

TEST(Predict, SlopesToEverySampleAreExact) {
  PwR p;
  p.frame.sample_s = 2e-3;
  p.frame.delay_samples = 1.5;
  const throttle::PwRModel model(p);
  const auto state = moving(model);
  std::vector<double> input{0.42, 0.21, 0.3, 0.47, 0.19, 0.33, 0.4, 0.26, 0.38};  // not a multiple of the lanes
  const std::size_t n = input.size();
  const auto run = [&](const std::vector<double>& u) { return test_support::respond(model, state, u); };
  std::vector<double> output(n), slopes(n * n, 1e9);
  const test_support::AllocationCounter counter;
  predict_every_sample(model, state, input, output,
                       [&](std::size_t k, std::size_t i, double slope) { slopes[k * n + i] = slope; });
  EXPECT_EQ(counter.count(), 0U);
  EXPECT_EQ(output, run(input));
  for (std::size_t i = 0; i < n; ++i) {
    auto up = input, down = input;
    up[i] += 1e-6;
    down[i] -= 1e-6;
    const auto high = run(up), low = run(down);
    for (std::size_t k = 0; k < n; ++k) {
      const double expected = (high[k] - low[k]) / 2e-6;
      EXPECT_NEAR(slopes[k * n + i], expected, 1e-5 * (1.0 + std::abs(expected))) << i << " at " << k;
      if (k >= i) continue;
      EXPECT_EQ(slopes[k * n + i], 0.0) << "no input acts before its time";
    }
  }
}

}  // namespace
}  // namespace mgdd::dynamics
