// Open area of a throttle plate: exact geometry by quadrature, monotone and continuous, closed with its leak.
#include "mgdd/throttle/demand/bore.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "mgdd/common/units.hpp"
#include "mgdd/throttle/demand/orifice.hpp"

namespace mgdd::throttle {
namespace {

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
