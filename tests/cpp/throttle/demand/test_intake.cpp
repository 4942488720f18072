// Air between throttle and torque: speed density, filling of the manifold (emptying exactly, Runge-Kutta as a second
// opinion), torque and its air.
#include "mgdd/throttle/demand/intake.hpp"

#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/rk4.hpp"
#include "support/demand_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::throttle {
namespace {

static_assert(dynamics::DiscreteModel<Manifold>);
static_assert(noexcept(std::declval<const Manifold&>().flows(std::declval<Manifold::State&>(), Manifold::Input{})));

using test_support::odd_air;
using test_support::odd_bore;

TEST(Intake, SpeedDensityIsTheGasInTheDisplacedVolume) {
  const IntakeAir air = odd_air();
  const double density = 61e3 / (air_gas_constant * 323.0);
  EXPECT_NEAR(air.pumping_kg_per_s_pa(3700.0) * 61e3, 0.91 * density * 1.62e-3 * 3700.0 / 120.0, 1e-15);
}

TEST(Intake, TorqueAndItsAirGoRound) {
  const EngineTorque engine{.indicated_efficiency = 0.37,
                            .heating_value_mj_per_kg = 43.1,
                            .stoichiometric_air_fuel = 14.3,
                            .air_fuel_ratio = 0.93,
                            .friction_nm = 11.0,
                            .friction_nm_per_rpm = 0.0041};
  for (const double speed : {800.0, 2300.0, 6000.0}) {
    for (const double torque : {-10.0, 0.0, 60.0, 180.0})
      EXPECT_NEAR(engine.torque_nm(engine.air_kg_per_s(torque, speed), speed), torque, 1e-12);
    EXPECT_EQ(engine.air_kg_per_s(-500.0, speed), 0.0);
    EXPECT_NEAR(engine.torque_nm(0.0, speed), -(11.0 + 0.0041 * speed), 1e-12);
  }
  // Fuel power times efficiency is indicated power.
  const double air = engine.air_kg_per_s(100.0, 3000.0);
  EXPECT_NEAR(air / (0.93 * 14.3) * 43.1e6 * 0.37, (100.0 + 11.0 + 12.3) * 3000.0 * M_PI / 30.0, 1e-8);
}

/// The same manifold as an ODE, its derivative written from the printed equations.
struct FillingOde {
  static constexpr int n_parameters = 1, n_states = 1, n_inputs = 2;  // parameter: not used
  IntakeAir air = odd_air();
  PlateOpening plate{odd_bore(0.1)};

  template <class C, class T, class U>
  std::array<T, 1> derivative(const std::array<C, 1>&, const std::array<T, 1>& p,
                              const std::array<U, 2>& in) const noexcept {
    const double pressure = static_cast<double>(p[0]);
    const double angle = in[0] * units::rad_per_deg;
    const double r = std::fmin(pressure, 96.4e3) / std::fmax(pressure, 96.4e3);
    const double from = std::fmax(pressure, 96.4e3), kelvin = pressure > 96.4e3 ? 323.0 : 287.0;
    const double area = plate.discharge(angle) * (1.0 - 0.1 * r) * plate.area_m2(angle);
    const double flow = area * from / std::sqrt(air_gas_constant * kelvin) * flow_function(r).value;
    const double in_flow = pressure > 96.4e3 ? -flow : flow;
    const double out = 0.91 * 1.62e-3 * in[1] / 120.0 * pressure / (air_gas_constant * 323.0);
    return {T(air_gas_constant * 323.0 / 2.3e-3 * (in_flow - out))};
  }
  template <class C, class T>
  T output(const std::array<C, 1>&, const std::array<T, 1>& p) const noexcept {
    return p[0];
  }
};

TEST(Manifold, AgreesWithRungeKuttaOfThePrintedEquations) {
  const dynamics::Rk4Model<FillingOde, double> fine{FillingOde{}, {0.0}, 1e-3, 40};
  const Manifold manifold(odd_air(), odd_bore(0.1), 1e-3);
  Manifold::State state{25e3};
  std::array<double, 1> reference{25e3};
  double worst = 0.0;
  for (int k = 0; k < 3000; ++k) {
    const double angle = k < 500 ? 7.0 : k < 1200 ? 85.0 : 20.0 + 18.0 * std::sin(0.02 * k);
    const double speed = 1400.0 + 0.5 * k;
    manifold.step(state, {angle, speed});
    fine.step(reference, std::array<double, 2>{angle, speed});
    worst = std::fmax(worst, std::fabs(state.pressure_pa - reference[0]));
  }
  EXPECT_LT(worst, 60.0);  // Pa
}

TEST(Manifold, FlowsOfASampleAreTheMeanOfItsFlows) {
  const Manifold coarse(odd_air(), odd_bore(0.1), 1e-2), fine(odd_air(), odd_bore(0.1), 1e-5);
  Manifold::State once{40e3}, often{40e3};
  const ManifoldFlows mean = coarse.flows(once, {33.0, 2100.0});
  double through = 0.0, out = 0.0;
  for (int i = 0; i < 1000; ++i) {
    through += fine.throttle_kg_per_s(33.0, often.pressure_pa) / 1000.0;
    out += odd_air().pumping_kg_per_s_pa(2100.0) * often.pressure_pa / 1000.0;
    fine.step(often, {33.0, 2100.0});
  }
  EXPECT_NEAR(mean.throttle_kg_per_s / through, 1.0, 2e-3);
  EXPECT_NEAR(mean.cylinder_kg_per_s / out, 1.0, 2e-3);
}

TEST(Manifold, FlowsOfAnEmptyingSampleAreExact) {
  const IntakeAir air = odd_air();
  ThrottleBore shut = odd_bore(0.0);
  shut.leak_mm2 = 0.0;
  const double tau = air.filling_time_s(1900.0);
  for (const double sample : {4e-6, 1e-3, 5e-2}) {
    Manifold::State state{60e3};
    const ManifoldFlows flows = Manifold(air, shut, sample).flows(state, {0.0, 1900.0});
    const double mean_pa = 60e3 * tau / sample * -std::expm1(-sample / tau);
    EXPECT_NEAR(flows.cylinder_kg_per_s / (air.pumping_kg_per_s_pa(1900.0) * mean_pa), 1.0, 1e-11) << sample;
    EXPECT_NEAR(flows.throttle_kg_per_s, 0.0, 1e-9);
  }
}

TEST(Manifold, AWideOpenThrottleNeitherOscillatesNorOvershoots) {
  ThrottleBore large = odd_bore(0.1);
  large.bore_mm = 90.0;
  IntakeAir small = odd_air();
  small.manifold_l = 0.8;
  const Manifold manifold(small, large, 5e-3);
  Manifold::State state{20e3};
  double last = state.pressure_pa;
  for (int i = 0; i < 200; ++i) {
    manifold.step(state, {90.0, 800.0});
    EXPECT_GE(state.pressure_pa, last - 1e-6);
    EXPECT_LE(state.pressure_pa, 96.4e3 * 1.0005);
    last = state.pressure_pa;
  }
}

TEST(Manifold, InputsThatAreNotFiniteRepeatTheLastOnes) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  const Manifold manifold(odd_air(), odd_bore(0.1), 1e-3);
  Manifold::State gap{40e3}, held{40e3};
  for (int k = 0; k < 200; ++k) {
    manifold.step(gap, {k % 3 == 0 && k > 0 ? nan : 21.0, k % 4 == 0 && k > 0 ? infinity : 2300.0});
    manifold.step(held, {21.0, 2300.0});
    EXPECT_EQ(gap.pressure_pa, held.pressure_pa) << k;
  }
  Manifold::State never{40e3};  // closed, at standstill
  manifold.step(never, {nan, nan});
  Manifold::State backwards{40e3};
  manifold.step(backwards, {0.0, -900.0});
  EXPECT_EQ(backwards.pressure_pa, never.pressure_pa);
  EXPECT_GT(never.pressure_pa, 40e3);
  EXPECT_LT(never.pressure_pa, 41e3);
}

TEST(Manifold, NoAllocation) {
  const Manifold manifold(odd_air(), odd_bore(0.1), 1e-3);
  Manifold::State state{40e3};
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 1000; ++k)
    (void)manifold.flows(state, {0.09 * k, 800.0 + k});
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::throttle
