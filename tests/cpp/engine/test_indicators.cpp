// Parabola and ringing intensity against closed forms.
#include "mgdd/engine/indicators.hpp"

#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

TEST(EngineIndicators, ParabolaFindsTheVertexOfAnyQuadraticOnAnyGrid) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> step(0.2, 2.0), vertex(-0.1, 0.1);
  for (int i = 0; i < 100; ++i) {
    const double left = step(random), right = step(random), at = vertex(random);
    const auto f = [&](double x) { return 80.0 - 1.7 * (x - 3.0 - at) * (x - 3.0 - at); };
    const Peak<double> peak =
        parabola_peak(PeakSamples<double>{3.0 - left, 3.0, 3.0 + right, f(3.0 - left), f(3.0), f(3.0 + right)});
    EXPECT_NEAR(peak.angle_cad, 3.0 + at, 1e-10);
    EXPECT_NEAR(peak.value, 80.0, 1e-10);
  }
}

TEST(EngineIndicators, ParabolaKeepsTheSampleAtAnEdgeAndOnAPlateau) {
  const std::array<double, 3> angle{0.0, 1.0, 3.0};
  const auto peak = [&angle](std::size_t k, const std::array<double, 3>& values) {
    return parabola_peak(samples_around<double>(angle, k, [&values](std::size_t i) { return values[i]; }));
  };
  EXPECT_EQ(peak(0, {5.0, 4.0, 2.0}).angle_cad, 0.0);
  EXPECT_EQ(peak(2, {2.0, 4.0, 5.0}).value, 5.0);
  EXPECT_EQ(peak(2, {2.0, 4.0, 5.0}).angle_cad, 3.0);
  EXPECT_EQ(peak(1, {5.0, 5.0, 5.0}).angle_cad, 1.0);
  EXPECT_EQ(peak(1, {5.0, 5.0, 5.0}).value, 5.0);
}

TEST(EngineIndicators, RingingIntensityByHand) {
  // 0.05 ms x 90 MPa/s = 4500 Pa; 4500^2/(2 1.3 1e7) sqrt(1.3 287.05 2000) = 672.85 W/m2
  EXPECT_NEAR(ringing_intensity_mw_per_m2(1.3, 90e6, 1e7, 2000.0), 672.85e-6, 1e-8);
  const double slope = 2.989262e5 * 6.0 * 1500.0 * 0.05e-3;
  const auto i = run(test_support::EngineCase()).indicators;
  const double expected = slope * slope / (2.0 * 1.37 * 107.1515e5) * std::sqrt(1.37 * 287.05 * 1958.72) * 1e-6;
  EXPECT_NEAR(i.ringing_intensity_mw_per_m2, expected, 1e-4 * expected);
}

}  // namespace
}  // namespace mgdd::engine
