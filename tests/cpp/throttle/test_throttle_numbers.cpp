// Numbers of a throttle: what a user gets who says nothing, what each field allows, and rules between fields.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/sensors.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/preset_file.hpp"

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

// A change of the preset is a breaking change.
TEST(ThrottleNumbers, DefaultsAreThePresetP1) {
  const Throttle standard;
  test_support::expect_preset(standard, fields(),
                              {{"friction", name_of(standard.friction)}, {"backlash", name_of(standard.backlash)}},
                              "P1", "throttle");
  EXPECT_EQ(default_step_s, 1e-4);
}

// --- what is allowed ------------------------------------------------------------------------------------------

TEST(ThrottleNumbers, EveryFieldHasItsBoundsAndTheyBelongWhereTheySay) {
  for (const auto& field : fields()) {
    const FieldInfo& info = field.info;
    const Domain& domain = info.domain;
    const auto with = [&](double value) {
      Throttle t = asymmetric_throttle();
      field.in(t) = value;
      return message(t);
    };
    const auto outside = [&](double value) {
      return with(value).find(": " + requirement(domain)) != std::string::npos;
    };
    EXPECT_EQ(outside(domain.lower), domain.lower_open) << info.name;
    EXPECT_TRUE(outside(domain.lower - 1e-9 * std::fmax(1.0, std::abs(domain.lower)))) << info.name;
    EXPECT_FALSE(outside(domain.upper)) << info.name;
    EXPECT_TRUE(outside(NAN)) << info.name;
    EXPECT_TRUE(outside(domain.upper * (1.0 + 1e-12))) << info.name;
    const std::string beyond = with(domain.upper * 2.0);
    EXPECT_EQ(beyond.rfind(std::string(info.name) + " = ", 0), 0U) << beyond;
    EXPECT_NE(beyond.find(text(domain.upper)), std::string::npos) << beyond;
    EXPECT_EQ(beyond.find(" " + std::string(info.unit) + ": must") != std::string::npos, info.unit != "-") << beyond;
  }
}

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

TEST(ThrottleNumbers, StepsAndColumnsHaveTheirs) {
  EXPECT_NO_THROW(ThrottlePlant(asymmetric_throttle(), 1e-6));
  EXPECT_NO_THROW(ThrottlePlant(asymmetric_throttle(), 5e-3));
  EXPECT_THROW(ThrottlePlant(asymmetric_throttle(), 0.9e-6), ParameterError);
  EXPECT_THROW(ThrottlePlant(asymmetric_throttle(), 5.1e-3), ParameterError);
  EXPECT_EQ(steps_per_sample(1e-3, 1e-3), 1U);
  EXPECT_EQ(steps_per_sample(3e-3, 1e-3), 3U);
  EXPECT_EQ(steps_per_sample(1e-2 * (1.0 + 5e-10), 1e-4), 100U);
  EXPECT_THROW(steps_per_sample(1e-2 * (1.0 + 3e-9), 1e-4), ParameterError);
  EXPECT_THROW(steps_per_sample(4e-4, 1e-3), ParameterError) << "less than one step";
  EXPECT_THROW(steps_per_sample(1e-2, 6e-3), ParameterError);
  EXPECT_THROW(steps_per_sample(1e-6, 0.5e-6), ParameterError);
  const std::vector<double> duty{0.5, -1.0, 1.0}, volts{12.0, 0.0, 9.0}, torque{0.0, -0.5, 0.5};
  EXPECT_NO_THROW(validate(ThrottleSignals{duty, volts, torque}));
  EXPECT_NO_THROW(validate(ThrottleSignals{.duty = duty}));
  const auto refused = [](const ThrottleSignals& signals, const std::string& part) {
    try {
      validate(signals);
      ADD_FAILURE() << part;
    } catch (const DataError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  const std::vector<double> beyond{0.0, 0.0, -1.01}, negative{12.0, -0.1, 12.0}, gap{0.0, NAN, 0.0}, two{1.0, 1.0};
  refused({.duty = beyond}, "duty = -1.01 at sample 2");
  refused({.duty = gap}, "duty is nan at sample 1");
  refused({.duty = duty, .supply_v = negative}, "supply_v = -0.1 V at sample 1");
  refused({.duty = duty, .airflow_torque_nm = gap}, "airflow_torque_nm is nan at sample 1");
  EXPECT_THROW(validate(ThrottleSignals{.duty = duty, .supply_v = two}), ShapeError);
  EXPECT_THROW(validate(ThrottleSignals{.duty = duty, .supply_v = {}, .airflow_torque_nm = two}), ShapeError);
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

}  // namespace
}  // namespace mgdd::throttle
