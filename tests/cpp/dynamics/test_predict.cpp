// Predictions, and the observer that starts them.
#include <span>

#include "mgdd/common/state.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/dynamics/predict.hpp"
#include "mgdd/throttle/models/first_principle.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/plant.hpp"
#include "support/no_alloc.hpp"
#include "support/respond.hpp"
#include "support/test.hpp"

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

// Column by column: names, derivatives beside their values, and a run that goes on as if nothing had been.
TEST(FixedGainObserver, ARestartGoesOnBitForBitOnDualsToo) {
  using D = Dual<3>;
  throttle::PwR p;
  p.frame.delay_samples = 2.5;
  auto lifted_p = throttle::lift<D>(p);
  lifted_p.above.gain_deg_per_s2_per_duty.grad = {1.0, 0.0, 0.0};
  lifted_p.above.coulomb_duty.grad = {0.0, 1.0, 0.0};
  const throttle::BasicPwRModel<D> model(lifted_p);
  using Observer = FixedGainObserver<throttle::BasicPwRModel<D>, throttle::ObserverGains>;
  const throttle::ObserverGains gains{.angle_gain = 0.3, .speed_gain_per_s = 20.0, .bias_gain_duty_per_deg = 0.002};
  Observer observer(model, gains);
  observer.start(model.at_rest(D(30.0)));
  const auto measured = [](int k) { return D(30.0 + 0.4 * k); };
  for (int k = 0; k < 12; ++k)
    static_cast<void>(observer.update(D(0.4), measured(k)));
  const StateColumns saved = save_state(observer);
  EXPECT_EQ(saved.size(), 9U * 4U);
  EXPECT_EQ(saved.at("position_deg"), std::vector{observer.state().position_deg.value});
  EXPECT_EQ(saved.at("position_deg_0"), std::vector{observer.state().position_deg.grad[0]});
  EXPECT_EQ(saved.at("speed_deg_per_s_1"), std::vector{observer.state().speed_deg_per_s.grad[1]});
  EXPECT_NE(saved.at("speed_deg_per_s_1").front(), 0.0);
  EXPECT_TRUE(saved.contains("before_4_2"));

  Observer copy(model, gains);
  restore_state(copy, saved);
  for (int k = 12; k < 20; ++k) {
    const D a = observer.update(D(0.3), measured(k)), b = copy.update(D(0.3), measured(k));
    EXPECT_EQ(a.value, b.value);
    EXPECT_EQ(a.grad, b.grad);
  }
}

// The same corrections as one observer makes sample by sample; from each of its states a plain run.
TEST(PredictAhead, IsARunFromEachStateOfTheObserver) {
  throttle::PwR p;
  p.frame.delay_samples = 1.5;
  const throttle::PwRModel model(p);
  const throttle::ObserverGains gains{.angle_gain = 0.2, .speed_gain_per_s = 21.0, .bias_gain_duty_per_deg = 0.003};
  constexpr std::size_t n = 60, steps = 7;
  std::vector<double> duty(n), angle(n), ahead(n - steps);
  for (std::size_t k = 0; k < n; ++k) {
    duty[k] = 0.25 + 0.2 * std::sin(0.3 * static_cast<double>(k));
    angle[k] = 20.0 + 3.0 * std::cos(0.11 * static_cast<double>(k));
  }
  predict_ahead(model, model.at_rest(19.0), gains, steps, duty, angle, ahead);
  auto state = model.at_rest(19.0);
  for (std::size_t k = 0; k < n - steps; ++k) {
    if (k > 0) model.step(state, duty[k - 1]);
    model.correct(state, angle[k], gains);
    const auto out = test_support::respond(model, state, std::span<const double>(duty).subspan(k, steps));
    ASSERT_EQ(ahead[k], out.back()) << k;
  }
  EXPECT_NE(ahead[10], ahead[11]);
}

}  // namespace
}  // namespace mgdd::dynamics
