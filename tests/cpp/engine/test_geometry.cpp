// Slider-crank: the slope against its volume by quadrature, and the bowl.
#include "mgdd/engine/geometry.hpp"

#include <gtest/gtest.h>

namespace mgdd::engine {
namespace {

TEST(EngineGeometry, SlopeIntegratesToTheVolume) {
  const Geometry<double> g{GeometryParameters<double>{}};
  double volume = g.volume_m3(-140.0);
  for (double a = -140.0; a < 130.0 - 1e-9; a += 1.0) {  // Simpson
    volume +=
        (g.volume_slope_m3_per_cad(a) + 4.0 * g.volume_slope_m3_per_cad(a + 0.5) + g.volume_slope_m3_per_cad(a + 1.0)) /
        6.0;
  }
  EXPECT_NEAR(volume / g.volume_m3(130.0), 1.0, 1e-9);
}

TEST(EngineGeometry, BowlFactorScalesTheDiscsOnly) {
  Cylinder c;
  const Geometry<double> flat(c.geometry);
  c.geometry.bowl_area_factor = 1.4;
  const Geometry<double> bowl(c.geometry);
  EXPECT_NEAR(bowl.wall_area_m2(1e-4) - flat.wall_area_m2(1e-4), 0.8 * flat.piston_area_m2, 1e-15);
  EXPECT_DOUBLE_EQ(flat.mean_piston_speed_m_per_s(1500.0), 4.3);
}

}  // namespace
}  // namespace mgdd::engine
