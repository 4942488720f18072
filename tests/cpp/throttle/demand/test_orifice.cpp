// Flow through an orifice: choking, the straight part, reversed flow, slopes.
#include "mgdd/throttle/demand/orifice.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace mgdd::throttle {
namespace {

constexpr double gamma = 1.4;

/// The printed equations, term by term.
double psi(double r) {
  const double critical = std::pow(2.0 / (gamma + 1.0), gamma / (gamma - 1.0));
  const double at = std::fmax(r, critical);
  return std::pow(at, 1.0 / gamma) *
         std::sqrt(2.0 * gamma / (gamma - 1.0) * (1.0 - std::pow(at, (gamma - 1.0) / gamma)));
}

TEST(Orifice, ItsConstantsAreThoseOfTheIsentropicNozzle) {
  EXPECT_DOUBLE_EQ(critical_ratio, std::pow(2.0 / (gamma + 1.0), gamma / (gamma - 1.0)));
  EXPECT_DOUBLE_EQ(choked_flow,
                   std::sqrt(gamma) * std::pow(2.0 / (gamma + 1.0), (gamma + 1.0) / (2.0 * (gamma - 1.0))));
  EXPECT_NEAR(critical_ratio, 0.528282, 5e-7);
  EXPECT_NEAR(choked_flow, 0.684731, 5e-7);
}

TEST(Orifice, TheFlowFunctionIsTheNozzlesUpToTheStraightPart) {
  for (double r = 0.0; r <= straight_from_ratio; r += 0.007)
    EXPECT_NEAR(flow_function(r).value, psi(r), 1e-14) << r;
  const double last = psi(straight_from_ratio);
  for (double r = straight_from_ratio; r <= 1.0; r += 0.001)
    EXPECT_NEAR(flow_function(r).value, last * (1.0 - r) / (1.0 - straight_from_ratio), 1e-14) << r;
  EXPECT_EQ(flow_function(1.0).value, 0.0);
  EXPECT_NEAR(flow_function(0.9).value, 0.42258, 5e-6);
}

TEST(Orifice, SlopesAreThoseOfTheFlow) {
  constexpr double h = 1e-6;
  for (const double r : {0.2, 0.6, 0.75, 0.9, 0.97, 0.985, 0.995}) {
    const double found = flow_function(r, 0.1).slope;
    const double wanted = (flow_function(r + h, 0.1).value - flow_function(r - h, 0.1).value) / (2.0 * h);
    EXPECT_NEAR(found, wanted, 1e-7) << r;
  }
  const GasState up{101325.0, 293.15};
  for (const double down : {20e3, 70e3, 90e3, 100e3, 101e3, 102e3, 140e3, 300e3}) {
    const auto flow = [&](double pressure) { return orifice_flow(1e-4, up, {pressure, 330.0}, 0.1); };
    const double wanted = (flow(down + 1.0).kg_per_s - flow(down - 1.0).kg_per_s) / 2.0;
    EXPECT_NEAR(flow(down).per_downstream_pa, wanted, 1e-12) << down;
    EXPECT_LE(flow(down).per_downstream_pa, 0.0);
  }
}

TEST(Orifice, FlowIsChokedBelowTheCriticalRatioAndFallsAboveIt) {
  const GasState up{98e3, 301.0};
  const double choked = orifice_flow(2e-5, up, {0.0, 310.0}).kg_per_s;
  EXPECT_EQ(orifice_flow(2e-5, up, {0.52 * 98e3, 310.0}).kg_per_s, choked);
  double last = choked;
  for (double r = 0.53; r < 1.2; r += 0.003) {
    const double flow = orifice_flow(2e-5, up, {r * 98e3, 310.0}).kg_per_s;
    EXPECT_LT(flow, last) << r;
    last = flow;
  }
}

TEST(Orifice, ReversedFlowIsThatOfTheSidesSwapped) {
  const GasState cold{97e3, 270.0}, hot{151e3, 340.0};
  for (const double loss : {0.0, 0.1}) {
    const double reversed = orifice_flow(3e-5, cold, hot, loss).kg_per_s;
    EXPECT_EQ(reversed, -orifice_flow(3e-5, hot, cold, loss).kg_per_s);
    EXPECT_LT(reversed, 0.0);
  }
  EXPECT_EQ(orifice_flow(3e-5, cold, {97e3, 340.0}).kg_per_s, 0.0);
}

}  // namespace
}  // namespace mgdd::throttle
