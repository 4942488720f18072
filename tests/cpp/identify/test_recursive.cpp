// On-line update of PW-R: tracks a change of the supply, rests without excitation, gates hold.
#include <type_traits>

#include "mgdd/common/state.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/identify/online/recursive_gradient.hpp"
#include "mgdd/identify/online/recursive_pw_r.hpp"
#include "mgdd/identify/online/recursive_window.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::identify {
namespace {

using test_support::Signal;
using throttle::PwR;
using Observer = dynamics::FixedGainObserver<throttle::PwRModel, throttle::ObserverGains>;

// P1 with a supply that rises by 20 % after `step_s`; every torque over g falls by as much.
test_support::ThrottleLog supply_step(double duration_s, double step_s) {
  const throttle::Throttle t = test_support::log_throttle();
  test_support::ThrottleLog log;
  log.duty = test_support::chirp(0.15, 0.17, 1.5, 3.5, duration_s);
  Signal supply(log.duty.size(), t.supply_v);
  for (std::size_t k = 0; k < supply.size(); ++k) {
    if (1e-3 * static_cast<double>(k) >= step_s) supply[k] *= 1.2;
  }
  // Slow position loop, as in the excitation rules, so that the plate stays in mid travel.
  log.true_deg.resize(log.duty.size());
  const throttle::ThrottlePlant plant(t);
  auto state = throttle::at_rest(45.0);
  for (std::size_t k = 0; k < log.duty.size(); ++k) {
    log.true_deg[k] = state.plate_angle_rad * 57.29577951308232;
    log.duty[k] -= 0.003 * (log.true_deg[k] - 45.0);
    for (int i = 0; i < 10; ++i)
      plant.step(state, {.duty = log.duty[k], .supply_v = supply[k]});
  }
  log.angle_deg = test_support::sensed(log.true_deg, 5);
  return log;
}

/// The estimator after a record; that of the gradient sees the duty that was held until a sample.
template <class Online>
Online after(const test_support::ThrottleLog& log) {
  constexpr bool gradient = std::is_same_v<Online, GradientPwR>;
  Online online({});
  if constexpr (gradient) online.start(log.angle_deg[0]);
  for (std::size_t k = 1; k < log.duty.size(); ++k) {
    static_cast<void>(online.update(log.duty[gradient ? k - 1 : k], log.angle_deg[k]));
    if constexpr (std::is_same_v<Online, WindowPwR>) {
      if (k % 50 == 49) static_cast<void>(online.iterate());
    }
  }
  return online;
}

TEST(RecursivePwR, TracksAStepOfTheSupply) {
  const auto log = supply_step(30.0, 10.0);
  RecursivePwR online(RecursivePwRSettings{});
  double before = 0.0;
  for (std::size_t k = 0; k < log.duty.size(); ++k) {
    static_cast<void>(online.update(log.duty[k], log.angle_deg[k]));
    if (k == 10000) before = online.model().above.gain_deg_per_s2_per_duty;
  }
  const auto after = online.model().above;
  EXPECT_NEAR(before, 83597.0, 0.08 * 83597.0);
  EXPECT_NEAR(after.gain_deg_per_s2_per_duty, 1.2 * 83597.0, 0.08 * 1.2 * 83597.0);
  EXPECT_NEAR(after.preload_duty, 0.1292 / 1.2, 0.012);
  EXPECT_NEAR(after.coulomb_duty * after.gain_deg_per_s2_per_duty, 0.0927 * 83597.0, 1e-6);  // held as a torque
  EXPECT_EQ(online.model().below, PwR{}.below);                                              // never visited
  EXPECT_GT(online.updates(), 500);
}

TEST(RecursivePwR, RestsWithoutExcitation) {
  RecursivePwR online(RecursivePwRSettings{});
  const Signal still = test_support::sensed(Signal(20000, 45.0), 3);
  for (const double angle : still)
    EXPECT_NE(online.update(0.15, angle), UpdateGate::updated);
  EXPECT_EQ(online.model(), PwR{});
}

TEST(RecursivePwR, GatesHold) {
  RecursivePwRSettings settings;
  settings.every = 1;
  settings.model.frame.sample_s = 5e-3;
  const auto last = [&](std::array<double, 3> angle) {
    RecursivePwR online(settings);
    UpdateGate gate = UpdateGate::filling;
    for (const double a : angle)
      gate = online.update(0.3, a);
    return gate;
  };
  EXPECT_EQ(last({40.0, 41.0, 43.0}), UpdateGate::updated);
  EXPECT_EQ(last({40.0, 40.05, 40.1}), UpdateGate::slow);
  EXPECT_EQ(last({40.0, 41.0, 40.0}), UpdateGate::slow);
  EXPECT_EQ(last({87.0, 88.0, 89.5}), UpdateGate::at_stop);
  EXPECT_EQ(last({8.2, 9.5, 11.0}), UpdateGate::limp_home);
  RecursivePwR online(settings);
  EXPECT_EQ(online.update(std::nan(""), 40.0), UpdateGate::not_finite);
  EXPECT_EQ(online.update(0.1, std::nan("")), UpdateGate::not_finite);
  settings.error_gate = 100.0;
  EXPECT_EQ(last({40.0, 41.0, 42.0}), UpdateGate::small);
}

TEST(RecursivePwR, EstimatesStayInsideTheirBounds) {
  RecursivePwRSettings settings;
  settings.free = {true, true, true, true, true};
  settings.every = 1;
  settings.model.frame.sample_s = 5e-3;
  RecursivePwR online(settings);
  for (int k = 0; k < 3000; ++k)
    static_cast<void>(online.update(k % 7 < 3 ? 1.0 : -1.0, 45.0 + 30.0 * std::sin(0.3 * k) * std::sin(0.0171 * k)));
  EXPECT_NO_THROW(online.model().validate());
  EXPECT_LE(online.above().covariance().trace(), online.above().settings().start_variance.sum() * (1.0 + 1e-12));
}

TEST(WindowPwR, TracksAStepOfTheSupply) {
  WindowPwR online = after<WindowPwR>(supply_step(12.0, 4.0));
  const auto after = online.model().above;
  EXPECT_NEAR(after.gain_deg_per_s2_per_duty, 1.2 * 83597.0, 0.1 * 1.2 * 83597.0);
  EXPECT_NEAR(after.preload_duty, 0.1292 / 1.2, 0.012);
  WindowPwR other(WindowPwRSettings{});
  restore_state(other, save_state(online));
  EXPECT_EQ(other.iterate(), online.iterate());
  EXPECT_EQ(save_state(other), save_state(online));
}

TEST(WindowPwR, ThePriorKeepsWhatTheWindowDoesNotExcite) {
  WindowPwR online(WindowPwRSettings{});
  const Signal still = test_support::sensed(Signal(2000, 45.0), 3);
  for (std::size_t k = 0; k < still.size(); ++k) {
    static_cast<void>(online.update(0.15, still[k]));
    if (k % 50 == 49) static_cast<void>(online.iterate());
  }
  const auto model = online.model().above;
  EXPECT_NEAR(model.gain_deg_per_s2_per_duty / 83597.0, 1.0, 0.02);
  EXPECT_NEAR(model.preload_duty / 0.1292, 1.0, 0.02);
}

TEST(GradientPwR, MovesTheGainTowardTheTruthAndKeepsItAtRest) {
  GradientPwR online = after<GradientPwR>(supply_step(30.0, 0.0));
  const auto after = online.model().above;
  EXPECT_NEAR(after.gain_deg_per_s2_per_duty, 1.2 * 83597.0, 0.12 * 1.2 * 83597.0);
  GradientPwR other(GradientPwRSettings{});
  restore_state(other, save_state(online));
  EXPECT_EQ(other.update(0.2, 44.0), online.update(0.2, 44.0));
  EXPECT_EQ(save_state(other), save_state(online));
  GradientPwR still(GradientPwRSettings{});
  still.start(45.0);
  for (const double angle : test_support::sensed(Signal(5000, 45.0), 3))
    static_cast<void>(still.update(0.15, angle));
  EXPECT_NEAR(still.model().above.gain_deg_per_s2_per_duty / 83597.0, 1.0, 0.01);
}

TEST(FixedGainObserver, FollowsThePlantBehindASupplyStep) {
  const auto log = supply_step(6.0, 3.0);
  Observer observer(throttle::PwRModel{PwR{}}, {});
  observer.start(observer.model().at_rest(log.angle_deg[0]));
  double worst = 0.0;
  for (std::size_t k = 1; k < log.duty.size(); ++k) {
    static_cast<void>(observer.update(log.duty[k - 1], log.angle_deg[k]));
    worst = std::max(worst, std::abs(observer.model().output(observer.state()) - log.true_deg[k]));
  }
  EXPECT_LT(worst, 0.5);
  auto copy = observer;
  restore_state(copy, save_state(observer));
  EXPECT_EQ(copy.update(0.1, 40.0), observer.update(0.1, 40.0));
  EXPECT_FALSE(std::isfinite(observer.update(0.1, std::nan(""))));
  EXPECT_TRUE(std::isfinite(observer.state().position_deg));
}

// Drops angle, duty or both at 80 places, some of them in a row.
test_support::ThrottleLog with_gaps(test_support::ThrottleLog log) {
  for (std::size_t i = 0; i < 80; ++i) {
    const std::size_t k = 100 + 100 * i + (i % 4) * (i % 7) + (i % 10 == 0 ? 0 : i % 3);
    if (i % 3 != 1) log.angle_deg[k] = std::nan("");
    if (i % 3 != 0) log.duty[k] = std::nan("");
  }
  return log;
}

template <class Online>
Online after_gaps(double most) {
  const auto log = supply_step(8.2, 3.0);
  const auto clean = after<Online>(log).model().above;
  const Online online = after<Online>(with_gaps(log));
  const auto above = online.model().above;
  EXPECT_NEAR(above.gain_deg_per_s2_per_duty / clean.gain_deg_per_s2_per_duty, 1.0, most);
  EXPECT_NEAR(above.preload_duty / clean.preload_duty, 1.0, most);
  return online;
}

TEST(RecursiveEstimators, DroppedSamplesCostNothingButThemselves) {
  const auto updates = after<RecursivePwR>(supply_step(8.2, 3.0)).updates();
  const auto fewer = after_gaps<RecursivePwR>(5e-3).updates();
  EXPECT_LT(fewer, updates);
  EXPECT_GT(fewer, updates * 8 / 10);
  WindowPwR window = after_gaps<WindowPwR>(0.01);
  const auto before = window.model().above;
  for (int k = 0; k < 600; ++k)
    EXPECT_FALSE(window.update(0.1, std::nan("")));
  EXPECT_FALSE(window.iterate());
  EXPECT_EQ(window.model().above, before);
  // A gap of half a second: the observer runs on instead of standing where the plate was.
  GradientPwR gradient = after_gaps<GradientPwR>(0.01);
  for (int k = 0; k < 500; ++k)
    EXPECT_EQ(gradient.update(1.0, std::nan("")), 0.0);
  EXPECT_GT(gradient.update(1.0, 90.0), -5.0);
  EXPECT_LT(gradient.update(1.0, 90.0), 5.0);
}

TEST(RecursiveRealTime, NothingIsAllocated) {
  RecursivePwR rls(RecursivePwRSettings{});
  WindowPwR window(WindowPwRSettings{});
  GradientPwR gradient(GradientPwRSettings{});
  Observer observer(throttle::PwRModel{PwR{}}, {});
  gradient.start(40.0);
  observer.start(observer.model().at_rest(40.0));
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 1200; ++k) {
    const double angle = 40.0 + 20.0 * std::sin(0.02 * k);
    static_cast<void>(rls.update(0.2, angle));
    static_cast<void>(window.update(0.2, angle));
    if (k % 50 == 0) static_cast<void>(window.iterate());
    static_cast<void>(gradient.update(0.2, angle));
    static_cast<void>(observer.update(0.2, angle));
  }
  EXPECT_EQ(counter.count(), 0u);
  static_assert(noexcept(rls.update(0.0, 0.0)) && noexcept(window.update(0.0, 0.0)) && noexcept(window.iterate()) &&
                noexcept(gradient.update(0.0, 0.0)) && noexcept(observer.update(0.0, 0.0)));
}

}  // namespace
}  // namespace mgdd::identify
