// Observers: the Kalman gain against an independent Riccati solution, a white innovation on the observer's own plant,
// dropped samples, restarts, the heap.
#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Dense>

#include "mgdd/common/random.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/dynamics/rk4.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/first_principle.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::dynamics {
namespace {

// x1' = x2, x2' = -4 x1 - 0.5 x2 + u, read with y = x1 + 0.3 x2.
struct Oscillator {
  static constexpr int n_states = 2;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 2;

  template <class C, class T, class U>
  std::array<T, 2> derivative(const std::array<C, 2>& p, const std::array<T, 2>& x,
                              const std::array<U, 1>& u) const noexcept {
    return {x[1], -(p[0] * x[0]) - p[1] * x[1] + u[0]};
  }
  template <class C, class T>
  T output(const std::array<C, 2>&, const std::array<T, 2>& x) const noexcept {
    return x[0] + 0.3 * x[1];
  }
};

TEST(KalmanObserver, SteadyGainIsThatOfAnIndependentRiccatiSolution) {
  const auto model = Rk4<Oscillator>{}.prepare(std::array{4.0, 0.5}, 0.1);
  using Observer = KalmanObserver<std::remove_const_t<decltype(model)>>;
  const Observer::Settings settings{.process = {1e-4, 4e-3}, .start = {1.0, 1.0}, .measurement = 0.02};
  Observer observer(model, settings);
  for (int k = 0; k < 2000; ++k)
    static_cast<void>(observer.update(0.0, 0.0));

  // The transition of one RK4 step by columns; the filter equation solved by structured doubling.
  Eigen::Matrix2d f;
  for (int j = 0; j < 2; ++j) {
    std::array<double, 2> x{j == 0 ? 1.0 : 0.0, j == 1 ? 1.0 : 0.0};
    model.step(x, std::array{0.0});
    f.col(j) << x[0], x[1];
  }
  const Eigen::RowVector2d h(1.0, 0.3);
  Eigen::Matrix2d a = f.transpose();
  Eigen::Matrix2d g = h.transpose() * h / 0.02;
  Eigen::Matrix2d p = Eigen::Vector2d(1e-4, 4e-3).asDiagonal();
  for (int i = 0; i < 30; ++i) {
    const Eigen::Matrix2d w = (Eigen::Matrix2d::Identity() + g * p).inverse();
    const Eigen::Matrix2d next = a * w * a;
    const Eigen::Matrix2d p_next = p + a.transpose() * p * w * a;
    g += a * w * g * a.transpose();
    a = next;
    p = p_next;
  }
  const Eigen::Vector2d gain = p * h.transpose() / (h * p * h.transpose() + 0.02);
  EXPECT_NEAR(observer.gain()[0], gain[0], 1e-12);
  EXPECT_NEAR(observer.gain()[1], gain[1], 1e-12);
}

// Without process noise the filter is least squares: the start that best fits what was stated of it, with its
// variances, and every measurement so far, carried forward by the model.
TEST(KalmanObserver, WithoutProcessNoiseItIsLeastSquaresFromItsStart) {
  const auto model = Rk4<Oscillator>{}.prepare(std::array{4.0, 0.5}, 0.1);
  using Observer = KalmanObserver<std::remove_const_t<decltype(model)>>;
  Observer observer(model, {.process = {}, .start = {0.7, 0.09}, .measurement = 0.02});
  const Eigen::Vector2d stated(0.3, -0.2);
  observer.start({stated[0], stated[1]});
  Eigen::Matrix2d f;
  for (int j = 0; j < 2; ++j) {
    std::array<double, 2> x{j == 0 ? 1.0 : 0.0, j == 1 ? 1.0 : 0.0};
    model.step(x, std::array{0.0});
    f.col(j) << x[0], x[1];
  }
  Eigen::Matrix2d normal = Eigen::Vector2d(1.0 / 0.7, 1.0 / 0.09).asDiagonal();
  Eigen::Vector2d right = normal * stated;
  Eigen::Matrix2d ahead = Eigen::Matrix2d::Identity();
  for (int k = 0; k < 25; ++k) {
    const double y = 1.3 * std::cos(0.4 * k) - 0.5;
    static_cast<void>(observer.update(0.0, y));
    ahead = f * ahead;
    const Eigen::RowVector2d row = Eigen::RowVector2d(1.0, 0.3) * ahead;
    normal += row.transpose() * row / 0.02;
    right += row.transpose() * y / 0.02;
    const Eigen::Vector2d now = ahead * normal.inverse() * right;
    const Eigen::Matrix2d spread = ahead * normal.inverse() * ahead.transpose();
    for (int i = 0; i < 2; ++i) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_NEAR(observer.state()[at], now[i], 1e-12) << k;
      for (int j = 0; j < 2; ++j)
        EXPECT_NEAR(observer.covariance()[at][static_cast<std::size_t>(j)], spread(i, j), 1e-13) << k;
    }
  }
}

template <class M>
void expect_white(const M& model, typename KalmanObserver<M>::Settings settings, double noise, double angle_deg) {
  KalmanObserver<M> observer(model, settings);
  auto plant = model.at_rest(angle_deg);
  observer.start(plant);
  constexpr int samples = 6000, lags = 20;
  std::vector<double> e;
  double scaled = 0.0;
  for (int k = 0; k < samples; ++k) {
    const double duty = 0.145 + 0.12 * std::sin(0.02 * k);
    model.step(plant, duty);
    // The plant drifts as the filter believes.
    *M::numbers(plant)[1] += std::sqrt(settings.process[1]) * random::normal(5, 1, static_cast<std::uint64_t>(k));
    const double y = model.output(plant) + noise * random::normal(5, 0, static_cast<std::uint64_t>(k));
    e.push_back(observer.update(duty, y));
    scaled += e.back() * e.back() / observer.innovation_variance() / samples;
  }
  EXPECT_NEAR(scaled, 1.0, 0.1);  // the variance that the filter states
  double power = 0.0;
  for (const double v : e)
    power += v * v;
  int outside = 0;
  for (int lag = 1; lag <= lags; ++lag) {
    double sum = 0.0;
    for (std::size_t k = static_cast<std::size_t>(lag); k < e.size(); ++k)
      sum += e[k] * e[k - static_cast<std::size_t>(lag)];
    outside += std::abs(sum / power) > 2.0 / std::sqrt(double(samples)) ? 1 : 0;
  }
  EXPECT_LE(outside, 3);  // of 20, one expected
}

TEST(KalmanObserver, InnovationIsWhiteOnTheOwnPlant) {
  // Little friction: a filter linearised about its own state cannot be optimal where plate and model stick apart.
  throttle::PwR p;
  p.above.coulomb_duty = p.below.coulomb_duty = 1e-4;
  const throttle::PwRModel pw_r{p};
  expect_white(pw_r, {.process = {0.0, 4.0, 0.0}, .start = {0.01, 1.0, 0.0}, .measurement = 9e-4}, 0.03, 40.0);
  auto values = throttle::first_principle_of(throttle::Throttle{});
  values[4] = 1e-4;
  const auto groups = throttle::FirstPrinciple{}.prepare(values, 1e-3);
  expect_white(groups, {.process = {0.0, 4.0, 0.0, 0.0}, .start = {0.01, 1.0, 1e-4, 0.0}, .measurement = 9e-4}, 0.03,
               40.0);
}

TEST(KalmanObserver, FindsABiasThatTheModelDoesNotKnow) {
  const throttle::PwRModel model{throttle::PwR{}};
  KalmanObserver<throttle::PwRModel> observer(
      model, {.process = {1e-6, 1.0, 1e-8}, .start = {0.01, 1.0, 1e-3}, .measurement = 9e-4});
  auto plant = model.at_rest(40.0);
  observer.start(plant);
  for (int k = 0; k < 4000; ++k) {
    const double duty = 0.25 + 0.15 * std::sin(0.02 * k);
    model.step(plant, duty - 0.03);
    static_cast<void>(observer.update(duty, model.output(plant) + 0.03 * random::normal(9, 0, std::uint64_t(k))));
  }
  EXPECT_NEAR(observer.state().bias_duty, 0.03, 0.004);
}

TEST(KalmanObserver, ADroppedSampleCorrectsNothingAndARestartGoesOnBitForBit) {
  throttle::PwR p;
  p.frame.delay_samples = 1.5;
  const throttle::PwRModel model{p};
  using Observer = KalmanObserver<throttle::PwRModel>;
  const Observer::Settings settings{.process = {1e-6, 1.0, 1e-8}, .start = {0.01, 1.0, 1e-3}, .measurement = 9e-4};
  Observer observer(model, settings);
  observer.start(model.at_rest(40.0));
  for (int k = 0; k < 50; ++k)
    static_cast<void>(observer.update(0.4, 40.0 + 0.3 * k));
  auto predicted = observer.state();
  model.step(predicted, 0.4);
  EXPECT_TRUE(std::isnan(observer.update(0.4, std::nan(""))));
  EXPECT_EQ(observer.state().position_deg, predicted.position_deg);
  EXPECT_EQ(observer.state().bias_duty, predicted.bias_duty);
  EXPECT_EQ(observer.gain(), Observer::Column{});

  Observer copy(model, settings);
  restore_state(copy, save_state(observer));
  for (int k = 0; k < 20; ++k)
    EXPECT_EQ(copy.update(0.3, 50.0 + 0.1 * k), observer.update(0.3, 50.0 + 0.1 * k));
  EXPECT_EQ(copy.covariance(), observer.covariance());
}

TEST(KalmanObserver, AllocatesNothingInDoubleAndFloat) {
  const auto run = []<class S>(S) {
    const throttle::BasicPwRModel<S> model(throttle::lift<S>(throttle::PwR{}));
    using Observer = KalmanObserver<throttle::BasicPwRModel<S>>;
    Observer observer(model, {.process = {S(0), S(1), S(1e-8)}, .start = {S(1), S(1), S(1)}, .measurement = S(1e-3)});
    observer.start(model.at_rest(S(30)));
    static_assert(noexcept(observer.update(S(0), S(0))));
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 100; ++k)
      static_cast<void>(observer.update(S(0.3), S(31)));
    EXPECT_EQ(counter.count(), 0U);
    EXPECT_TRUE(std::isfinite(observer.state().position_deg));
  };
  run(double{});
  run(float{});
}

TEST(KalmanObserver, NamesWrongVariances) {
  const throttle::PwRModel model{throttle::PwR{}};
  using Observer = KalmanObserver<throttle::PwRModel>;
  EXPECT_THROW(Observer(model, {.process = {-1.0, 0.0, 0.0}}), ParameterError);
  EXPECT_THROW(Observer(model, {.measurement = 0.0}), ParameterError);
  EXPECT_NO_THROW(Observer(model, {}));
}

TEST(KalmanObserver, AStartForgetsAndAnotherModelIsTakenWhole) {
  using Model = std::remove_const_t<decltype(Rk4<Oscillator>{}.prepare(std::array{4.0, 0.5}, 0.1))>;
  const Model model = Rk4<Oscillator>{}.prepare(std::array{4.0, 0.5}, 0.1);
  const Model other = Rk4<Oscillator>{}.prepare(std::array{9.0, 0.1}, 0.1);
  const KalmanSettings<double, 2> settings{.process = {1e-4, 4e-3}, .start = {1.0, 0.5}, .measurement = 0.02};
  KalmanObserver<Model> used(model, settings), fresh(other, settings);
  for (int k = 0; k < 40; ++k)
    static_cast<void>(used.update(0.2, 0.1 * k));
  used.set_model(other);
  used.start({0.3, -0.2});
  fresh.start({0.3, -0.2});
  EXPECT_EQ(used.covariance(), fresh.covariance());
  for (int k = 0; k < 20; ++k) {
    EXPECT_EQ(used.update(0.2, 0.1 * k), fresh.update(0.2, 0.1 * k));
    EXPECT_EQ(used.covariance(), fresh.covariance());
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
    auto copy = state;
    std::vector<double> out(horizon);
    respond(model, copy, std::span<const double>(duty).subspan(k, horizon), std::span<double>(out));
    ASSERT_EQ(ahead[k], out.back()) << k;
  }
  EXPECT_NE(ahead[10], ahead[11]);
}

}  // namespace
}  // namespace mgdd::dynamics
