// Receding-horizon control: exact on a linear model, its cost falls from iteration to iteration on others, preview
// helps, limits hold in every sample, a wanted output that stays takes one sweep.
#include "mgdd/control/receding_horizon.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/throttle/models/first_principle.hpp"
#include "support/receding_case.hpp"

namespace mgdd::control {
namespace {

using namespace test_support;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
template <class Table>
std::size_t index_of(const Table& table, std::string_view name) {
  const auto at = std::ranges::find(table, name, &FieldInfo::name);
  return static_cast<std::size_t>(at - table.begin());
}

/// The plate with a lag of its current and a duty that acts 1.4 samples late.
auto plate(double delay_samples) {
  throttle::FirstPrinciple family;
  family.friction = throttle::Friction::tanh;
  family.substeps = 1;
  auto groups = throttle::first_principle_of(throttle::Throttle{});
  const auto delay = index_of(throttle::FirstPrinciple::parameters, "delay_samples");
  groups[delay] = delay_samples;
  return family.prepare(groups, 2e-3);
}
using Plate = decltype(plate(0.0));

template <class M>
std::vector<typename M::Scalar> outputs(const M& model, typename M::State s, const Eigen::VectorXd& u) {
  std::vector<typename M::Scalar> y;
  for (Eigen::Index k = 0; k < u.size(); ++k) {
    model.step(s, dynamics::input_of(model, u(k)));
    y.push_back(model.output(s));
  }
  return y;
}

/// Quadratic model of the cost of a run about inputs, from differences of outputs.
template <class M>
test_support::DenseHorizon by_differences(const M& model, const typename M::State& state, const HorizonSettings& s,
                                          const Eigen::VectorXd& about, double before, double reference, double h) {
  const Eigen::Index n = about.size();
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3 * n, n);
  Eigen::VectorXd rest = Eigen::VectorXd::Zero(3 * n);
  const auto at = outputs(model, state, about);
  const auto weight = [&](Eigen::Index k) { return std::sqrt(k + 1 < n ? s.output_weight : s.terminal_weight); };
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::VectorXd up = about, down = about;
    up(i) += h;
    down(i) -= h;
    const auto above = outputs(model, state, up), below = outputs(model, state, down);
    for (Eigen::Index k = 0; k < n; ++k)
      rows(k, i) = weight(k) * (above[static_cast<std::size_t>(k)] - below[static_cast<std::size_t>(k)]) / (2.0 * h);
    rows(n + i, i) = std::sqrt(s.input_weight);
    rows(2 * n + i, i) = std::sqrt(s.change_weight);
    if (i > 0) rows(2 * n + i, i - 1) = -std::sqrt(s.change_weight);
  }
  for (Eigen::Index k = 0; k < n; ++k)
    rest(k) = weight(k) * (at[static_cast<std::size_t>(k)] - reference);
  for (Eigen::Index i = 0; i < n; ++i)
    rest.head(n) -= rows.col(i).head(n) * about(i);
  rest(2 * n) = -std::sqrt(s.change_weight) * before;
  return test_support::DenseHorizon::of(rows, rest);
}

template <class Controller>
Eigen::VectorXd plan(const Controller& c) {
  return Eigen::Map<const Eigen::VectorXd>(c.inputs().data(), static_cast<Eigen::Index>(c.inputs().size()));
}

TEST(RecedingHorizon, OneIterationIsExactOnALinearModelInEverySampleOfALoop) {
  const auto model = oscillator<double>();
  const auto s = narrow_settings();
  RecedingHorizon<Oscillator<double>, length> controller(model, s);
  const auto plant =
      dynamics::Rk4<LaggedOscillator>{}.prepare(std::array{5.6}, 0.05);  // so that states are not foreseen
  std::array<double, 3> x{0.4, -1.0, 0.3};
  controller.start(x, 0.3);
  double before = 0.3;
  for (int k = 0; k < 250; ++k) {
    const double u = controller.step(x, reference_of(k));
    ASSERT_EQ(controller.status(), HorizonStatus::converged);
    const auto dense =
        by_differences(model, x, s, Eigen::VectorXd::Zero(length), before, reference_of(k), 1.0);  // exact: linear
    ASSERT_LT(test_support::broken_optimality(dense, plan(controller), {s.lower, s.upper, s.largest_change, before}),
              1e-9)
        << k;
    ASSERT_EQ(u, controller.inputs()[0]);
    plant.step(x, std::array{u});
    before = u;
  }
}

TEST(RecedingHorizon, TheCostNeverRisesOverTheIterationsAndEndsWhereNothingIsBetter) {
  const auto model = pendulum<double>();
  for (const double angle : {-2.4, -0.7, 0.3, 1.9}) {
    for (const double reference : {1.2, -0.6}) {
      const std::array<double, 2> x{angle, 1.5};
      auto s = narrow_settings();
      s.input_weight = 0.05;
      s.lower = -1.0;
      double last = std::numeric_limits<double>::infinity();
      for (int most = 2; most <= 60; ++most) {
        s.max_iterations = most;
        s.tolerance = 1e-9;
        RecedingHorizon<Swinging<double>, length> controller(model, s);
        controller.start(x, 0.1);
        (void)controller.step(x, reference);
        const double before = 0.1;
        double cost = 0.0, previous = before;
        const auto y = outputs(model, x, plan(controller));
        for (std::size_t k = 0; k < length; ++k) {
          const double u = controller.inputs()[k];
          cost += (k + 1 < length ? s.output_weight : s.terminal_weight) * std::pow(y[k] - reference, 2) +
                  s.input_weight * u * u + s.change_weight * (u - previous) * (u - previous);
          previous = u;
        }
        ASSERT_LE(cost, last * (1.0 + 1e-14)) << angle << " " << most;
        last = cost;
        if (controller.status() == HorizonStatus::converged) {
          const auto dense = by_differences(model, x, s, plan(controller), before, reference, 1e-5);
          EXPECT_LT(
              test_support::broken_optimality(dense, plan(controller), {s.lower, s.upper, s.largest_change, before}),
              1e-6);
          break;
        }
        ASSERT_LT(most, 60) << "not converged from " << angle << " to " << reference;
      }
    }
  }
}

TEST(RecedingHorizon, ADelayedInputIsPlannedThroughTheNumbersOfItsLine) {
  const auto model = plate(1.4);
  HorizonSettings s;
  s.change_weight = 5.0;
  s.max_iterations = 50;
  s.tolerance = 1e-10;
  RecedingHorizon<Plate, length> controller(model, s);
  const auto x = model.at_rest(20.0, 0.2);
  controller.start(x, 0.2);
  (void)controller.step(x, 31.0);
  ASSERT_EQ(controller.status(), HorizonStatus::converged);
  const auto dense = by_differences(model, x, s, plan(controller), 0.2, 31.0, 1e-5);
  EXPECT_LT(test_support::broken_optimality(dense, plan(controller), {s.lower, s.upper, 1e30, 0.2}), 1e-6);
}

/// Root mean square error of a loop on the pendulum.
double loop_error(bool preview, const HorizonSettings& s) {
  const auto model = pendulum<double>();
  RecedingHorizon<Swinging<double>, length> controller(model, s);
  std::array<double, 2> x{0.0, 0.0};
  controller.start(x, 0.0);
  double sum = 0.0;
  std::array<double, length> ahead{};
  for (int k = 0; k < 400; ++k) {
    for (int j = 0; j < length; ++j)
      ahead[static_cast<std::size_t>(j)] = reference_of(k + 1 + j);
    const double u = preview ? controller.step(x, ahead) : controller.step(x, reference_of(k + 1));
    model.step(x, std::array{u});
    sum += std::pow(model.output(x) - reference_of(k + 1), 2);
  }
  return std::sqrt(sum / 400.0);
}

TEST(RecedingHorizon, PreviewOfTheReferenceBeatsAHeldOne) {
  auto s = narrow_settings();
  s.lower = -1.0;
  s.upper = 1.0;
  s.largest_change = 0.4;
  EXPECT_LT(loop_error(true, s), 0.75 * loop_error(false, s));
}

TEST(RecedingHorizon, LimitsHoldInEverySampleAndBind) {
  const auto model = pendulum<double>();
  auto s = narrow_settings();
  s.largest_change = 0.07;
  for (const int sweeps : {1, 2, 60}) {
    s.max_sweeps = sweeps;
    RecedingHorizon<Swinging<double>, length> controller(model, s);
    std::array<double, 2> x{0.0, 0.0};
    double before = 0.0;
    int at_bound = 0, at_change = 0;
    controller.start(x, before);
    for (int k = 0; k < 500; ++k) {
      const double u = controller.step(x, 3.0 * reference_of(k));
      ASSERT_GE(u, s.lower);
      ASSERT_LE(u, s.upper);
      ASSERT_LE(u, before + s.largest_change);
      ASSERT_GE(u, before - s.largest_change);
      at_bound += u == s.lower || u == s.upper;
      at_change += std::abs(std::abs(u - before) - s.largest_change) < 1e-12;
      model.step(x, std::array{u});
      before = u;
    }
    EXPECT_GT(at_bound, 20);
    EXPECT_GT(at_change, 10);
  }
}

TEST(RecedingHorizon, ChangesCountFromWhatReallyActed) {
  RecedingHorizon<Swinging<double>, length> controller(pendulum<double>(), narrow_settings());
  const std::array<double, 2> x{0.1, 0.0};
  controller.start(x, 0.0);
  (void)controller.step(x, 2.0);
  controller.applied(-0.4);
  controller.applied(nan);
  EXPECT_LE(controller.step(x, 2.0), -0.4 + 0.17);
  controller.prepare();
  controller.applied(0.6);
  EXPECT_GE(controller.feedback(x, -2.0), 0.6 - 0.17);
}

TEST(RecedingHorizon, AWantedOutputThatStaysTakesOneSweepPerSample) {
  const auto model = pendulum<double>();
  RecedingHorizon<Swinging<double>, length> controller(model, narrow_settings());
  std::array<double, 2> x{0.0, 0.0};
  controller.start(x, 0.0);
  int sweeps = 0;
  for (int k = 0; k < 400; ++k) {
    model.step(x, std::array{controller.step(x, 0.25)});
    sweeps += controller.sweeps();
    if (k > 100) {
      ASSERT_EQ(controller.sweeps(), 1) << k;
    }
  }
  EXPECT_LT(sweeps, 520);
}

}  // namespace
}  // namespace mgdd::control
