// Receding-horizon control while it runs: bad numbers repeat the last input, prepared or not is the same, both scalars,
// a restart bit for bit, refused states and settings, no allocation.
#include "mgdd/control/receding_horizon.hpp"

#include <functional>
#include <limits>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"
#include "support/receding_case.hpp"

namespace mgdd::control {
namespace {

using namespace test_support;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(RecedingHorizon, WhatIsNotFiniteRepeatsTheLastInputAndTheNextSampleGoesOn) {
  const auto model = pendulum<double>();
  RecedingHorizon<Swinging<double>, length> controller(model, narrow_settings());
  std::array<double, 2> x{0.1, 0.0};
  controller.start(x, 0.2);
  const double u = controller.step(x, 0.4);
  const std::array<double, 3> torn{0.1, nan, 0.3};
  const auto repeats = [&](auto&& call) {
    EXPECT_EQ(call(), u);
    EXPECT_EQ(controller.status(), HorizonStatus::not_finite);
  };
  repeats([&] { return controller.step({nan, 0.0}, 0.4); });
  repeats([&] { return controller.step({0.1, std::numeric_limits<double>::infinity()}, 0.4); });
  repeats([&] { return controller.step(x, nan); });
  repeats([&] { return controller.step(x, torn); });
  repeats([&] { return controller.step(x, std::span<const double>()); });
  const double after = controller.step(x, 0.4);
  EXPECT_EQ(controller.status(), HorizonStatus::converged);
  EXPECT_TRUE(std::isfinite(after));
  // A state that the model carries out of the numbers.
  for (const int iterations : {1, 5}) {
    auto s = narrow_settings();
    s.max_iterations = iterations;
    RecedingHorizon<Swinging<double>, length> other(model, s);
    other.start(x, 0.2);
    (void)other.step(x, 0.4);
    const double held = other.inputs()[0];
    EXPECT_EQ(other.step({1e308, 1e308}, 0.4), held);
    EXPECT_EQ(other.status(), HorizonStatus::not_finite);
    (void)other.step(x, 0.4);  // the plan is along numbers that are not finite: seen and started anew
    EXPECT_TRUE(std::isfinite(other.step(x, 0.4)));
    EXPECT_NE(other.status(), HorizonStatus::not_finite);
  }
}

TEST(RecedingHorizon, PreparedOrNotTheAnswerIsTheSame) {
  const auto model = pendulum<double>();
  RecedingHorizon<Swinging<double>, length> one(model, narrow_settings()), other = one, third = one;
  std::array<double, 2> x{0.0, 0.0};
  for (auto* c : {&one, &other, &third})
    c->start(x, 0.0);
  for (int k = 0; k < 200; ++k) {
    const double u = one.step(x, reference_of(k));
    if (k % 3 != 0) other.prepare();
    if (k % 5 == 0) other.prepare();
    ASSERT_EQ(other.feedback(x, reference_of(k)), u);
    ASSERT_EQ(third.feedback(x, reference_of(k)), u);
    model.step(x, std::array{u});
    x[1] += 0.01 * std::cos(0.7 * k);
  }
}

TEST(RecedingHorizon, FloatAgreesWithDouble) {
  const auto model = pendulum<double>();
  const auto small = pendulum<float>();
  RecedingHorizon<Swinging<double>, length> wide(model, narrow_settings());
  RecedingHorizon<Swinging<float>, length> narrow(small, narrow_settings());
  std::array<double, 2> x{0.0, 0.0};
  for (int k = 0; k < 300; ++k) {
    const double u = wide.step(x, reference_of(k));
    const std::array<float, 2> seen{static_cast<float>(x[0]), static_cast<float>(x[1])};
    ASSERT_NEAR(narrow.step(seen, static_cast<float>(reference_of(k))), u, 2e-3) << k;
    ASSERT_EQ(narrow.status(), HorizonStatus::converged) << k;
    model.step(x, std::array{u});
  }
}

template <class T>
void goes_on_bit_for_bit() {
  const auto model = pendulum<T>();
  auto s = narrow_settings();
  s.max_iterations = 2;
  RecedingHorizon<Swinging<T>, length> first(model, s), second(model, s);
  std::array<T, 2> x{T(0.3), T(0.0)};
  first.start(x, T(0.1));
  for (int k = 0; k < 300; ++k) {
    if (k % 3 == 0) restore_state(second, save_state(first));
    first.prepare();
    if (k % 4 == 1) restore_state(second, save_state(first));
    const T r = static_cast<T>(reference_of(k)), u = first.feedback(x, r);
    ASSERT_EQ(second.feedback(x, r), u) << k;
    model.step(x, std::array{static_cast<double>(u)});
  }
}

TEST(RecedingHorizon, GoesOnBitForBitAfterARestore) {
  goes_on_bit_for_bit<double>();
  goes_on_bit_for_bit<float>();
}

TEST(RecedingHorizon, AStateThatTheSettingsDoNotAllowIsRefusedAndChangesNothing) {
  RecedingHorizon<Swinging<double>, length> controller(pendulum<double>(), narrow_settings());
  controller.start({0.0, 0.0}, 0.0);
  (void)controller.step({0.0, 0.0}, 1.0);
  const StateColumns before = save_state(controller);
  const auto refused = [&](const std::string& name, double value) {
    StateColumns bad = before;
    bad.at(name) = {value};
    EXPECT_THROW(restore_state(controller, bad), ParameterError) << name;
  };
  refused("applied", 0.9);
  refused("input_3", -0.46);
  refused("input_5", before.at("input_4")[0] + 0.2);
  refused("tie_2", 2.0);
  refused("bound_7", -0.5);
  refused("shifted", 3.0);
  refused("state_1", nan);
  EXPECT_EQ(save_state(controller), before);
}

TEST(RecedingHorizon, NoAllocation) {
  using Wide = RecedingHorizon<Swinging<double>, length>;
  using Narrow = RecedingHorizon<Swinging<float>, length>;
  static_assert(noexcept(std::declval<Wide&>().step(std::array{0.0, 0.0}, 0.0)));
  static_assert(noexcept(std::declval<Narrow&>().step(std::array{0.0F, 0.0F}, 0.0F)));
  static_assert(noexcept(std::declval<Wide&>().prepare()) && noexcept(std::declval<Wide&>().start({}, 0.0)));
  const auto model = pendulum<double>();
  auto s = narrow_settings();
  s.max_iterations = 3;
  Wide wide(model, s);
  Narrow narrow(pendulum<float>(), s);
  std::array<double, 2> x{0.3, 0.0};
  const test_support::AllocationCounter counter;
  wide.start(x, 0.0);
  for (int k = 0; k < 200; ++k) {
    model.step(x, std::array{wide.step(x, reference_of(k))});
    (void)narrow.step({static_cast<float>(x[0]), static_cast<float>(x[1])}, static_cast<float>(reference_of(k)));
  }
  (void)wide.step({nan, 0.0}, 0.0);
  wide.applied(0.3);
  EXPECT_EQ(counter.count(), 0U);
}

TEST(RecedingHorizon, ARefusedSettingNamesItself) {
  const auto refused = [](const std::string& field, const std::function<void(HorizonSettings&)>& change) {
    HorizonSettings s = narrow_settings();
    change(s);
    try {
      validate(s);
      ADD_FAILURE() << field << " was taken";
    } catch (const ParameterError& error) {
      EXPECT_EQ(error.field, field);
    }
  };
  refused("output_weight", [](HorizonSettings& s) { s.output_weight = -1.0; });
  refused("terminal_weight", [](HorizonSettings& s) { s.terminal_weight = nan; });
  refused("change_weight", [](HorizonSettings& s) { s.input_weight = s.change_weight = 0.0; });
  refused("upper", [](HorizonSettings& s) { s.upper = s.lower; });
  refused("largest_change", [](HorizonSettings& s) { s.largest_change = 0.0; });
  refused("tolerance", [](HorizonSettings& s) { s.tolerance = 0.0; });
  refused("max_iterations", [](HorizonSettings& s) { s.max_iterations = 0; });
  refused("max_sweeps", [](HorizonSettings& s) { s.max_sweeps = 0; });
}

TEST(RecedingHorizon, EveryNumberOfTheSettingsHasOneField) {
  HorizonSettings s;
  double at = 0.5;
  for (const auto& field : horizon_fields())
    field.in(s) = at += 1.0;
  EXPECT_EQ(sizeof(HorizonSettings), horizon_fields().size() * sizeof(double) + 2 * sizeof(int));
  at = 0.5;
  for (const auto& field : horizon_fields())
    EXPECT_EQ(field.in(s), at += 1.0);
}

}  // namespace
}  // namespace mgdd::control
