// Numbers of a throttle: what a user gets who says nothing, what each field allows, and rules between fields.
#include "mgdd/common/error.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/sensors.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/test.hpp"

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

}  // namespace
}  // namespace mgdd::throttle
