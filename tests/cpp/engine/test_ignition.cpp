// Ignition delay: printed correlations, the integral by other quadrature, U-shape, inverse and its limits.
#include "mgdd/engine/ignition.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;

TEST(EngineIgnition, CorrelationsAtSixtyBar) {
  EXPECT_NEAR(watson_delay_ms(60.0, 900.0), 0.553, 0.005 * 0.553);
  EXPECT_NEAR(wolfer_delay_ms(60.0, 900.0), 0.591, 0.005 * 0.591);
  EXPECT_NEAR(hardenberg_hase_delay_cad(60.0, 900.0, 45.0, 4.3), 1.950, 0.005 * 1.95);
  EXPECT_TRUE(std::isinf(hardenberg_hase_delay_cad(12.4, 900.0, 45.0, 4.3)));
}

TEST(EngineIgnition, DelayIsWhereTheIntegralReachesOne) {
  const EngineCase fine("fuel_mg=0 step_cad=0.05");
  const Cycle cycle = run(fine);
  for (const char* name : {"watson", "wolfer"}) {
    EngineCase c;
    c.cylinder.ignition.ignition_model = parse_name<IgnitionModel>("ignition_model", name);
    for (const double soi : {-25.0, -12.0, -3.0, 6.0}) {
      const IgnitionTiming t = start_of_combustion(c.cylinder, c.point, soi);
      ASSERT_TRUE(t.ignites);
      double integral = 0.0;
      for (std::size_t k = 0; k + 1 < cycle.work.pressure_pa.size(); ++k) {
        const double angle = cycle.model.angles_cad()[k];
        const double inside = std::clamp(t.soc_cad - angle, 0.0, 0.05) - std::clamp(soi - angle, 0.0, 0.05);
        const double bar = cycle.work.pressure_pa[k] / 1e5;
        const double kelvin = cycle.work.pressure_pa[k] * cycle.model.volume_m3()[k] / cycle.charge.gas_j_per_k;
        const double tau = std::string(name) == "watson" ? 3.52 * std::pow(bar, -1.022) * std::exp(2100.0 / kelvin)
                                                         : 0.44 * std::pow(bar, -1.19) * std::exp(4650.0 / kelvin);
        integral += inside / (6.0 * 1500.0) * 1e3 / tau;
      }
      EXPECT_NEAR(integral, 1.0, 0.01) << name << " " << soi;
    }
  }
}

TEST(EngineIgnition, DelayIsUShapedOverInjection) {
  const EngineCase c;
  const auto delay = [&](double soi) { return start_of_combustion(c.cylinder, c.point, soi).delay_cad; };
  double lowest = 1e9, at = 0.0;
  for (double soi = -30.0; soi <= 10.0; soi += 0.1) {
    if (delay(soi) < lowest) lowest = delay(soi), at = soi;
  }
  EXPECT_NEAR(lowest, 3.82, 0.02);
  EXPECT_NEAR(at, -2.2, 0.3);
  for (double soi = -30.0; soi < 10.0; soi += 0.5) {
    if (soi + 0.5 < at - 0.5) {
      EXPECT_GT(delay(soi), delay(soi + 0.5));
    }
    if (soi > at + 0.5) {
      EXPECT_LT(delay(soi), delay(soi + 0.5));
    }
    EXPECT_LT(std::abs(delay(soi + 0.5) - delay(soi)), 0.5);  // so SOC rises with SOI
  }
  EXPECT_GT(delay(-20.0), 1.7 * delay(-5.0));
}

TEST(EngineIgnition, InverseReturnsTheInjection) {
  for (const char* model : {"watson", "wolfer", "hardenberg_hase", "polynomial"}) {
    EngineCase c("ignition_model=" + std::string(model));
    for (const double soc : {-10.0, -6.0, 0.0, 4.5}) {
      const IgnitionTiming back = start_of_injection(c.cylinder, c.point, soc);
      ASSERT_FALSE(back.clipped) << model << soc;
      EXPECT_NEAR(start_of_combustion(c.cylinder, c.point, back.soi_cad).soc_cad, soc, 1e-6) << model;
      EXPECT_NEAR(back.delay_cad, soc - back.soi_cad, 1e-6);
    }
  }
}

TEST(EngineIgnition, UnreachableTimingIsClippedToTheEdge) {
  EngineCase c;
  const IgnitionTiming early = start_of_injection(c.cylinder, c.point, -40.0);
  EXPECT_TRUE(early.clipped);
  EXPECT_DOUBLE_EQ(early.soi_cad, -60.0);
  EXPECT_NEAR(early.soc_cad, -18.8, 0.06);
  c.point.speed_rpm = 8000.0;  // at such a speed even the latest injection that ignites does so before 20 CAD
  const IgnitionTiming fast = start_of_injection(c.cylinder, c.point, -30.0);
  EXPECT_TRUE(fast.clipped);
}

TEST(EngineIgnition, LateInjectionDoesNotIgnite) {
  for (const auto& [speed, last] : {std::pair{1500.0, 18.0}, std::pair{3000.0, 10.5}}) {
    EngineCase c;
    c.point.speed_rpm = speed;
    EXPECT_TRUE(start_of_combustion(c.cylinder, c.point, last - 0.1).ignites);
    const IgnitionTiming t = start_of_combustion(c.cylinder, c.point, last + 0.3);
    EXPECT_FALSE(t.ignites);
    EXPECT_TRUE(std::isnan(t.soc_cad));
    EXPECT_EQ(t.soi_cad, last + 0.3);
  }
}

TEST(EngineIgnition, PolynomialIsThePolynomial) {
  const EngineCase c("ignition_model=polynomial ignition_c0_cad=4 ignition_c1=0.1 ignition_c2_per_cad=0.02");
  EXPECT_NEAR(start_of_combustion(c.cylinder, c.point, -10.0).delay_cad, 4.0 - 1.0 + 2.0, 1e-12);
}

TEST(EngineIgnition, WindowIsChecked) {
  const EngineCase c;
  EXPECT_THROW(start_of_combustion(c.cylinder, c.point, -61.0), ParameterError);
  EXPECT_THROW(start_of_injection(c.cylinder, c.point, std::nan("")), ParameterError);
}

}  // namespace
}  // namespace mgdd::engine
