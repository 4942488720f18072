// Flow past the plate: the bore that it leaves open, and the orifice.
#include "mgdd/common/units.hpp"
#include "mgdd/throttle/demand/bore.hpp"
#include "mgdd/throttle/demand/orifice.hpp"
#include "support/test.hpp"

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

constexpr double deg = units::rad_per_deg;

ThrottleBore without_leak() {
  ThrottleBore bore;
  bore.leak_mm2 = 0.0;
  return bore;
}

/// Bore minus the larger of the plate's and the shaft's shadow, chord by chord: the plate is round where it closes.
double shadow_area_m2(const ThrottleBore& bore, double angle_deg) {
  const double radius = 0.5e-3 * bore.bore_mm, half_shaft = 0.5e-3 * bore.shaft_mm;
  const double shrink = std::cos((angle_deg + bore.plate_closed_deg) * deg) / std::cos(bore.plate_closed_deg * deg);
  constexpr int n = 400000;
  double area = 0.0;
  for (int i = 0; i < n; ++i) {
    const double along_shaft = radius * (-1.0 + 2.0 * (i + 0.5) / n);
    const double chord = std::sqrt(radius * radius - along_shaft * along_shaft);
    const double shadow = std::min(chord, std::max(half_shaft, std::max(shrink, 0.0) * chord));
    area += 2.0 * (chord - shadow) * 2.0 * radius / n;
  }
  return area;
}

TEST(Bore, AreaIsThatOfTheShadows) {
  ThrottleBore bore = without_leak();
  bore.bore_mm = 52.0;
  bore.shaft_mm = 9.0;
  bore.plate_closed_deg = 11.0;
  const PlateOpening plate(bore);
  for (const double angle : {0.0, 3.0, 17.0, 41.0, 66.0, 71.0, 74.0, 83.0, 90.0})
    EXPECT_NEAR(plate.area_m2(angle * deg), shadow_area_m2(bore, angle), 2e-9) << angle;
}

TEST(Bore, AreaIsMonotoneContinuousAndStartsAtTheLeak) {
  const PlateOpening bare(without_leak()), leaking(ThrottleBore{});
  EXPECT_EQ(bare.area_m2(0.0), 0.0);
  EXPECT_DOUBLE_EQ(leaking.area_m2(0.0), 3e-6);
  double last = 0.0;
  for (int i = 1; i <= 90000; ++i) {
    const double area = bare.area_m2(i * 1e-3 * deg);
    EXPECT_GE(area, last) << i;
    EXPECT_LT(area - last, 8e-8) << i;  // at most 0.08 mm2 per 0.001 deg
    EXPECT_NEAR(leaking.area_m2(i * 1e-3 * deg) - area, 3e-6, 1e-18);
    last = area;
  }
  const double wide = std::numbers::pi / 4.0 * 60e-3 * 60e-3;
  EXPECT_LT(last, wide - 0.9 * 8e-3 * 60e-3);  // the shaft stays
}

TEST(Bore, AnglesBeyondTheTravelAreCut) {
  const PlateOpening plate(ThrottleBore{});
  EXPECT_EQ(plate.area_m2(-5.0 * deg), plate.area_m2(0.0));
  EXPECT_EQ(plate.effective_m2(130.0 * deg), plate.effective_m2(90.0 * deg));
}

TEST(Bore, DischargeIsConstantBelowFiveDegAndLinearBetweenItsKnots) {
  const PlateOpening plate(ThrottleBore{});
  EXPECT_EQ(plate.discharge(0.0), 0.65);
  EXPECT_DOUBLE_EQ(plate.discharge(4.9 * deg), 0.65);
  EXPECT_NEAR(plate.discharge(12.5 * deg), 0.70, 1e-12);
  EXPECT_NEAR(plate.discharge(45.0 * deg), 0.85, 1e-12);
  EXPECT_NEAR(plate.discharge(90.0 * deg), 0.90, 1e-12);
}

}  // namespace
}  // namespace mgdd::throttle
