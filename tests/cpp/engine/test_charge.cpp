// The gas of a cycle: from a mass, from p, V and T at IVC, from the intake; by hand.
#include "mgdd/engine/charge.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::EngineCase;

constexpr double air_j_per_gk = 0.287055;  // 8.314462618 / 28.9647

TEST(EngineCharge, MassAndGasAreTheSameThingTwice) {
  EXPECT_NEAR(gas_of_mass_j_per_k(2.5), 2.5 * air_j_per_gk, 1e-5);
  EXPECT_NEAR(mass_of_gas_g(gas_of_mass_j_per_k(0.73)), 0.73, 1e-15);
}

TEST(EngineCharge, ATemperatureAtIvcGivesPressureTimesVolumeOverIt) {
  const EngineCase c("ivc_temperature_k=361 intake_pressure_kpa=170 ivc_pressure_rise_kpa=5");
  const Geometry<double> g(c.cylinder.geometry);
  const double by_hand_g = 175e3 * g.volume_m3(-140.0) / (air_j_per_gk * 361.0);
  const auto cycle = run(c);
  EXPECT_NEAR(mass_of_gas_g(cycle.charge.gas_j_per_k) / by_hand_g, 1.0, 1e-5);
  EXPECT_NEAR(cycle.temperature_k(-140.0), 361.0, 1e-9);
  const EngineCase stated("ivc_temperature_k=361 trapped_mass_g=0.7");  // the mass wins
  EXPECT_NEAR(mass_of_gas_g(run(stated).charge.gas_j_per_k), 0.7, 1e-12);
}

TEST(EngineCharge, TheIntakeConditionsStayTheDefaultOfASimulation) {
  const EngineCase c;
  const double by_hand_g = 0.9 * 150e3 * Geometry<double>(c.cylinder.geometry).swept_m3 / (air_j_per_gk * 313.0);
  EXPECT_NEAR(mass_of_gas_g(run(c).charge.gas_j_per_k) / by_hand_g, 1.0, 1e-5);
}

// A polytropic compression of n = 1.35 gives back its pressure at IVC from wherever the trace starts; n = 1.40 misses
// by ((V/V_ivc)^-0.05 - 1).
TEST(EngineCharge, ThePressureOfALateStartIsCarriedBackToIvc) {
  const Geometry<double> g{GeometryParameters<double>{}};
  const double ivc = -140.0, volume = g.volume_m3(ivc);
  for (const auto& [exponent, from] : {std::pair{1.35, -140.0}, std::pair{1.35, -120.0}, std::pair{1.40, -125.0}}) {
    std::vector<double> angle, pressure;
    for (double a = from; a <= 0.0; a += 0.5) {
      angle.push_back(a);
      pressure.push_back(1.7 * std::pow(g.volume_m3(a) / volume, -exponent));
    }
    double miss = 0.0;  // mean over the first 5 CAD, 11 samples
    for (int k = 0; k <= 10; ++k)
      miss += std::pow(g.volume_m3(from + 0.5 * k) / volume, 1.35 - exponent) / 11.0;
    EXPECT_NEAR(ivc_pressure<double>(angle, pressure, g, ivc), 1.7 * miss, 1e-12);
    EXPECT_LT(std::abs(miss - 1.0), 0.011);
  }
}

}  // namespace
}  // namespace mgdd::engine
