// Burn laws: limits, closed forms, inverse, and the slope by quadrature.
#include "mgdd/engine/burn.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace mgdd::engine {
namespace {

std::vector<Cylinder> laws() {
  std::vector<Cylinder> all(5);
  all[1].burn.burn_shape = BurnShape::wiebe;
  all[2].burn.burn_shape = BurnShape::double_wiebe;
  all[3].burn.burn_shape = BurnShape::double_wiebe;
  all[3].burn.second_delay_cad = -4.0;  // the second law may start first
  all[4].burn.burn_shape = BurnShape::wiebe;
  all[4].burn.wiebe_a = 2.0;
  all[4].burn.wiebe_m = -0.3;
  return all;
}

TEST(EngineBurn, FractionRisesFromZeroToOne) {
  for (const Cylinder& c : laws()) {
    const Burn<double> burn(c.burn, -6.3, 31.7);
    EXPECT_EQ(burn.fraction(burn.start_cad()), 0.0);
    EXPECT_DOUBLE_EQ(burn.fraction(burn.end_cad()), 1.0);
    EXPECT_DOUBLE_EQ(burn.fraction(burn.end_cad() + 100.0), 1.0);
    double last = 0.0;
    for (double a = burn.start_cad(); a <= burn.end_cad(); a += 0.1) {
      EXPECT_GE(burn.fraction(a), last);
      last = burn.fraction(a);
    }
  }
}

TEST(EngineBurn, AngleInvertsTheFraction) {
  for (const Cylinder& c : laws()) {
    const Burn<double> burn(c.burn, -6.3, 31.7);
    for (const double x : {0.01, 0.1, 0.5, 0.9, 0.99}) {
      EXPECT_NEAR(burn.fraction(burn.angle_of(x)), x, 1e-12);
    }
  }
}

TEST(EngineBurn, SlopeIsThatOfTheFraction) {
  Cylinder c;
  c.burn.wiebe_a = 5.3;
  c.burn.wiebe_m = 2.2;
  c.burn.second_fraction = 0.35;
  c.burn.second_delay_cad = 4.5;
  c.burn.second_duration_cad = 43.0;
  c.burn.second_wiebe_m = 1.1;
  for (const BurnShape shape : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
    c.burn.burn_shape = shape;
    const Burn<double> burn(c.burn, -6.3, 31.7);
    for (const double a : {-4.0, 1.0, 6.5, 14.0, 21.0}) {
      const double difference = (burn.fraction(a + 1e-4) - burn.fraction(a - 1e-4)) / 2e-4;
      EXPECT_NEAR(burn.slope_at(a), difference, 1e-8) << static_cast<int>(shape) << " at " << a;
    }
  }
}

TEST(EngineBurn, WiebeByHand) {
  Cylinder c;
  c.burn.burn_shape = BurnShape::wiebe;
  const Burn<double> burn(c.burn, 0.0, 1.0);
  const double whole = 1.0 - std::exp(-6.908);
  EXPECT_NEAR(burn.fraction(0.3), (1.0 - std::exp(-6.908 * std::pow(0.3, 2.5))) / whole, 1e-15);
  EXPECT_NEAR(burn.angle_of(0.5), std::pow(std::log(2.0) / 6.908, 0.4), 3e-4);  // before renormalisation
  EXPECT_NEAR(burn.angle_of(0.5), 0.398, 5e-4);
  // The Wiebe law nearest to the triangle meets it at a quarter and at a half.
  for (const double s : {0.25, 0.5}) {
    EXPECT_NEAR(1.0 - std::exp(-3.60 * std::pow(s, 2.38)), triangle_fraction(s), 2e-3);
  }
}

TEST(EngineBurn, DoubleWiebeIsTheWeightedSum) {
  Cylinder c;
  c.burn.burn_shape = BurnShape::double_wiebe;
  const Burn<double> both(c.burn, -6.0, 20.0);
  for (const double a : {-5.0, -1.0, 5.0, 20.0, 45.0}) {
    const double first = wiebe_fraction((a + 6.0) / 20.0, c.burn.wiebe_a, c.burn.wiebe_m);
    const double second = wiebe_fraction((a + 3.0) / 50.0, c.burn.wiebe_a, c.burn.second_wiebe_m);
    EXPECT_NEAR(both.fraction(a), 0.4 * first + 0.6 * second, 1e-15);
  }
  c.burn.second_fraction = 0.0;
  const Burn<double> one(c.burn, -6.0, 20.0);
  c.burn.burn_shape = BurnShape::wiebe;
  const Burn<double> plain(c.burn, -6.0, 20.0);
  EXPECT_DOUBLE_EQ(one.fraction(3.3), plain.fraction(3.3));
}

}  // namespace
}  // namespace mgdd::engine
