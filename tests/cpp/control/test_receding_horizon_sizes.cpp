// Receding-horizon control with sizes told at run time, and with soft bounds of the output: the same answer as with
// sizes that the compiler knows, the least cost where a bound is broken, hard limits kept, wrong sizes refused.
#include <algorithm>
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/control/receding_horizon.hpp"
#include "mgdd/dynamics/linear_model.hpp"
#include "support/receding_case.hpp"

namespace mgdd::control {
namespace {

using namespace test_support;
using dynamics::LinearModel;
using AnySize = RecedingHorizon<LinearModel, Eigen::Dynamic, Eigen::Dynamic>;

/// The oscillator as matrices, column by column from unit states.
LinearModel oscillator_matrices() {
  const auto exact = oscillator<double>();
  Eigen::MatrixXd a(3, 3);
  Eigen::VectorXd b(3), c(3);
  for (std::size_t j = 0; j < 4; ++j) {
    std::array<double, 3> x{};
    if (j < 3) x[j] = 1.0;
    if (j < 3) c(static_cast<Eigen::Index>(j)) = exact.output(x);
    exact.step(x, std::array{j < 3 ? 0.0 : 1.0});
    for (std::size_t i = 0; i < 3; ++i)
      (j < 3 ? a(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) : b(static_cast<Eigen::Index>(i))) = x[i];
  }
  return {a, b, c, 0.05};
}

TEST(RecedingHorizonSizes, ToldAtRunTimeTheAnswerIsTheSame) {
  const auto exact = oscillator<double>();
  const LinearModel model = oscillator_matrices();
  for (const int iterations : {1, 6}) {
    auto s = narrow_settings();
    s.max_iterations = iterations;
    s.least_output = -0.1;
    s.largest_output = 0.35;
    s.output_limit_weight = 40.0;
    RecedingHorizon<Oscillator<double>, length> fixed(exact, s);
    AnySize told(model, s, length);
    std::array<double, 3> x{0.4, -1.0, 0.3};
    for (int k = 0; k < 250; ++k) {
      LinearModel::State wide{};
      std::ranges::copy(x, wide.begin());
      const double u = fixed.step(x, reference_of(k));
      ASSERT_NEAR(told.step(wide, reference_of(k)), u, 1e-9) << k;
      ASSERT_EQ(told.status(), fixed.status()) << k;
      exact.step(x, std::array{u});
      x[1] += 0.02 * std::cos(0.9 * k);
    }
  }
}

TEST(RecedingHorizonSizes, ASoftBoundIsBrokenWhereThatIsCheapestAndNowhereElse) {
  const LinearModel model = oscillator_matrices();
  auto s = narrow_settings();
  s.largest_change = 1e3;
  s.lower = -500.0;
  s.upper = 600.0;
  s.least_output = -0.25;
  s.largest_output = 0.3;
  int above = 0, below = 0;
  for (const double price : {0.5, 20.0, 3e3}) {
    s.output_limit_weight = price;
    AnySize controller(model, s, 23);
    for (const double reference : {0.8, 0.1, -0.9}) {
      for (const double speed : {-4.0, 0.0, 3.0}) {
        LinearModel::State x{0.2, speed, -0.4};
        controller.start(x, 0.1);
        (void)controller.step(x, reference);
        ASSERT_EQ(controller.status(), HorizonStatus::converged);
        // The cost by its definition, and its slope by differences: zero where no hard limit acts.
        const auto cost = [&](const std::vector<double>& u) {
          auto at = x;
          double sum = 0.0, before = 0.1;
          for (std::size_t k = 0; k < u.size(); ++k) {
            model.step(at, u[k]);
            const double y = model.output(at);
            const double excess = std::max({0.0, y - s.largest_output, s.least_output - y});
            above += y > s.largest_output;
            below += y < s.least_output;
            sum += (k + 1 < u.size() ? s.output_weight : s.terminal_weight) * std::pow(y - reference, 2) +
                   price * excess * excess + s.input_weight * u[k] * u[k] +
                   s.change_weight * std::pow(u[k] - before, 2);
            before = u[k];
          }
          return sum;
        };
        const auto& best = controller.inputs();
        const double least = cost(best);
        AnySize fresh(model, s, 23);  // whose changes count from 0.1 still
        fresh.start(x, 0.1);
        EXPECT_NEAR(fresh.cost(x, best, std::array{reference}), least, 1e-12 * least);
        for (std::size_t k = 0; k < best.size(); ++k) {
          ASSERT_LT(std::abs(best[k]), 499.0);
          auto more = best, less = best;
          more[k] += 1e-4;
          less[k] -= 1e-4;
          EXPECT_LT(std::abs(cost(more) - cost(less)) / 2e-4, 1e-7 * (1.0 + price)) << k << " " << price;
        }
      }
    }
  }
  EXPECT_GT(above, 1000);
  EXPECT_GT(below, 1000);
}

TEST(RecedingHorizonSizes, ASoftBoundGivesWayToHardOnes) {
  const LinearModel model = oscillator_matrices();
  auto s = narrow_settings();
  s.largest_output = 0.1;
  s.output_limit_weight = 1e5;
  AnySize controller(model, s, 12);
  LinearModel::State x{0.9, 2.0, 0.0};  // beyond the bound, whatever is done
  controller.start(x, 0.2);
  double before = 0.2;
  for (int k = 0; k < 400; ++k) {
    const double u = controller.step(x, 0.4);
    ASSERT_EQ(controller.status(), HorizonStatus::converged) << k;
    ASSERT_GE(u, std::max(s.lower, before - s.largest_change));
    ASSERT_LE(u, std::min(s.upper, before + s.largest_change));
    before = u;
    model.step(x, u);
  }
  EXPECT_NEAR(model.output(x), 0.1, 0.02);
}

TEST(RecedingHorizonSizes, ARestoredRunGoesOnBitForBit) {
  auto s = narrow_settings();
  s.largest_output = 0.3;
  s.output_limit_weight = 9.0;
  const LinearModel model = oscillator_matrices();
  AnySize first(model, s, 11), second(model, s, 11), longer(model, s, 12);
  LinearModel::State x{0.2, 1.0, 0.4};
  for (int k = 0; k < 100; ++k) {
    if (k % 7 == 3) restore_state(second, save_state(first));
    if (k < 3) (void)second.step(x, reference_of(k));
    const double u = first.step(x, reference_of(k));
    if (k >= 3) {
      ASSERT_EQ(second.step(x, reference_of(k)), u) << k;
    }
    model.step(x, u);
  }
  EXPECT_EQ(save_state(first).count("state_3"), 0U);
  const auto kept = save_state(longer);
  EXPECT_THROW(restore_state(longer, save_state(first)), ParameterError);
  EXPECT_EQ(save_state(longer), kept);
}

TEST(RecedingHorizonSizes, WrongSizesAreRefused) {
  const Eigen::Matrix2d a = Eigen::Matrix2d::Identity();
  const Eigen::Vector2d b(1.0, 0.5), c(0.0, 1.0);
  EXPECT_THROW(LinearModel(Eigen::MatrixXd::Zero(2, 3), b, c, 0.1), ShapeError);
  EXPECT_THROW(LinearModel(Eigen::MatrixXd::Zero(33, 33), b, c, 0.1), ShapeError);
  EXPECT_THROW(LinearModel(a, Eigen::Vector3d(1.0, 0.0, 0.0), c, 0.1), ShapeError);
  EXPECT_THROW(LinearModel(a, b, Eigen::Vector2d(1.0, NAN), 0.1), ParameterError);
  EXPECT_THROW(LinearModel(a, b, c, 0.0), ParameterError);
  EXPECT_THROW(AnySize(LinearModel(a, b, c, 0.1), HorizonSettings{}, 0), ParameterError);
  HorizonSettings s;
  s.least_output = 1.0;
  s.largest_output = -1.0;
  EXPECT_THROW(validate(s), ParameterError);
}

}  // namespace
}  // namespace mgdd::control
