// Numbers of a throttle: what a user gets who says nothing, what each field allows, and rules between fields.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/models/smooth.hpp"
#include "mgdd/throttle/sensors.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"

namespace mgdd::throttle {
namespace {

using test::asymmetric_throttle;

std::string message(const Throttle& t) {
  try {
    validate(t);
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "";
}

// --- what is allowed ------------------------------------------------------------------------------------------

TEST(ThrottleNumbers, RulesBetweenFields) {
  const auto with = [](auto change) {
    Throttle t = asymmetric_throttle();
    change(t);
    return message(t);
  };
  EXPECT_NE(with([](Throttle& t) { t.open_deg = t.closed_deg = t.limp_home_deg; }).find("above closed_deg"),
            std::string::npos);
  EXPECT_EQ(with([](Throttle& t) { t.limp_home_deg = t.closed_deg; }), "");
  EXPECT_EQ(with([](Throttle& t) { t.limp_home_deg = t.open_deg; }), "");
  EXPECT_NE(with([](Throttle& t) { t.limp_home_deg = t.closed_deg - 0.1; }).find("limp_home_deg"), std::string::npos);
  EXPECT_NE(with([](Throttle& t) { t.limp_home_deg = t.open_deg + 0.1; }).find("limp_home_deg"), std::string::npos);
  for (const auto& [form, name] : names<Friction>()) {
    const bool uses = form != Friction::coulomb && form != Friction::tanh;
    const auto friction = [form = form](double coulomb, double stiction) {
      return [=](Throttle& t) { t.friction = form, t.coulomb_nm = coulomb, t.stiction_nm = stiction; };
    };
    EXPECT_EQ(with(friction(0.2, 0.2)), "") << name;
    EXPECT_EQ(with(friction(0.2, 0.19)).empty(), !uses) << name;
    EXPECT_EQ(with(friction(0.0, 0.1)).empty(), form != Friction::lugre) << name;
  }
  EXPECT_NE(with([](Throttle& t) { t.driver_drop_v = t.supply_v; }).find("driver_drop_v"), std::string::npos);
  EXPECT_EQ(with([](Throttle& t) { t.plate_inertia_kgm2 = t.inertia_kgm2; }), "");
  EXPECT_NE(with([](Throttle& t) {
              t.backlash = Backlash::compliance, t.plate_inertia_kgm2 = t.inertia_kgm2;
            }).find("plate_inertia_kgm2"),
            std::string::npos);
  EXPECT_EQ(with([](Throttle& t) { t.backlash = Backlash::compliance; }), "");
}

// --- air flow and the smooth twin -----------------------------------------------------------------------------

TEST(ThrottleNumbers, TheClosingTorqueOfTheAirIsTheLineThroughItsTable) {
  const std::pair<double, double> table[] = {{0.0, 0.0},    {10.0, 0.003}, {20.0, 0.008}, {30.0, 0.015},
                                             {40.0, 0.025}, {50.0, 0.040}, {60.0, 0.060}, {70.0, 0.080},
                                             {75.0, 0.085}, {80.0, 0.070}, {90.0, 0.0}};
  for (std::size_t i = 0; i < std::size(table); ++i) {
    EXPECT_NEAR(airflow_coefficient(table[i].first), table[i].second, 1e-15) << i;
    if (i == 0) continue;
    const auto& [a, low] = table[i - 1];
    const auto& [b, high] = table[i];
    EXPECT_NEAR(airflow_coefficient(0.3 * a + 0.7 * b), 0.3 * low + 0.7 * high, 1e-15) << i;
  }
  EXPECT_EQ(airflow_coefficient(-1.0), 0.0);
  EXPECT_EQ(airflow_coefficient(91.0), 0.0);
  EXPECT_EQ(airflow_coefficient(NAN), 0.0);
  EXPECT_NEAR(airflow_torque_nm(asymmetric_throttle(), 60.0), -0.052 * 0.052 * 0.052 * 7000.0 * 0.060, 1e-15);
}

TEST(SmoothPlant, SolvesItsEquations) {
  const SmoothPlant plant{.inertia_kgm2 = 3e-3, .gear_ratio = 17.0, .inductance_h = 2e-3, .supply_v = 13.0};
  const std::array<double, 10> p{0.016, 4e-3, 0.12, 0.5, 0.13, 0.25, 0.02, 0.14, 0.018, 1.2};
  const auto c = plant.coefficients(p);
  for (const double away : {-0.05, -0.01, 0.01, 0.2}) {
    for (const double speed : {-3.0, -0.2, 0.4, 2.0}) {
      const std::array<double, 3> x{0.14 + away, speed, 0.7};
      const auto dx = plant.derivative(c, x, std::array<double, 1>{0.3});
      const double torque = 17.0 * 0.016 * 0.7 - 4e-3 * speed - 0.12 * std::tanh(speed / 0.5) - 0.13 * away -
                            0.25 * std::tanh(away / 0.02);
      EXPECT_NEAR(dx[0], speed, 1e-15);
      EXPECT_NEAR(dx[1], torque / 3e-3, 1e-9);
      EXPECT_NEAR(dx[2], (13.0 * 0.3 - 1.2 * 0.7 - 17.0 * 0.018 * speed) / 2e-3, 1e-9);
      EXPECT_NEAR(plant.output(c, x), (0.14 + away) * 180.0 / M_PI, 1e-12);
    }
  }
  EXPECT_EQ(SmoothPlant{}, (SmoothPlant{2e-3, 20.0, 1e-3, 12.0}));
  EXPECT_EQ(SmoothPlant::n_states, 3);
  EXPECT_EQ(SmoothPlant::n_inputs, 1);
  EXPECT_EQ(SmoothPlant::n_parameters, 10);
}

}  // namespace
}  // namespace mgdd::throttle
