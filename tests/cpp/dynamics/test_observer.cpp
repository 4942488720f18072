// The observer with fixed gains: restarts, and predictions ahead of its states.
#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "support/respond.hpp"

namespace mgdd::dynamics {
namespace {

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
  constexpr std::size_t n = 60, horizon = 7;
  std::vector<double> duty(n), angle(n), ahead(n - horizon);
  for (std::size_t k = 0; k < n; ++k) {
    duty[k] = 0.25 + 0.2 * std::sin(0.3 * static_cast<double>(k));
    angle[k] = 20.0 + 3.0 * std::cos(0.11 * static_cast<double>(k));
  }
  predict_ahead(model, model.at_rest(19.0), gains, horizon, duty, angle, ahead);
  auto state = model.at_rest(19.0);
  for (std::size_t k = 0; k < n - horizon; ++k) {
    if (k > 0) model.step(state, duty[k - 1]);
    model.correct(state, angle[k], gains);
    const auto out = test_support::respond(model, state, std::span<const double>(duty).subspan(k, horizon));
    ASSERT_EQ(ahead[k], out.back()) << k;
  }
  EXPECT_NE(ahead[10], ahead[11]);
}

}  // namespace
}  // namespace mgdd::dynamics
