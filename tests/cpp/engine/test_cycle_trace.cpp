// Traces and scans at the desk agree with the model that loops run.
#include "mgdd/engine/cycle_trace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace mgdd::engine {
namespace {

TEST(CycleTrace, HoldsItsOwnIndicatorsAndTheFirstLaw) {
  const CycleTrace t = trace_cycle({}, {}, -6.0, 1.0, Integrator::trapezoid);
  const std::size_t n = t.angle_cad.size();
  ASSERT_GT(n, 100u);
  double p_max = 0.0, released = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    p_max = std::max(p_max, t.pressure_bar[k]);
    if (k > 0) released += t.heat_release_j_per_cad[k] * (t.angle_cad[k] - t.angle_cad[k - 1]);
  }
  EXPECT_NEAR(p_max, t.indicators.p_max_bar, 0.1);  // which lies between two samples
  EXPECT_GE(t.indicators.p_max_bar, p_max);
  EXPECT_NEAR(released, t.fuel_heat_j, 1e-9 * t.fuel_heat_j);
  EXPECT_EQ(t.burned_fraction.front(), 0.0);
  EXPECT_NEAR(t.burned_fraction.back(), 1.0, 1e-12);
  EXPECT_EQ(t.heat_release_j_per_cad.front(), 0.0);
  EXPECT_EQ(t.work_booked_j.front(), 0.0);
  for (std::size_t k = 1; k < n; ++k) {
    const double step = t.angle_cad[k] - t.angle_cad[k - 1];
    const double heat = step * (t.heat_release_j_per_cad[k] - t.heat_loss_j_per_cad[k]);
    EXPECT_NEAR(t.energy_change_j[k] + t.work_booked_j[k], heat, 1e-9 * t.fuel_heat_j) << k;
  }
}

TEST(CycleTrace, AMotoredCycleBurnsNothing) {
  OperatingPoint motored;
  motored.fuel_mg = 0.0;
  const CycleTrace t = trace_cycle({}, motored, -6.0, 1.0, Integrator::trapezoid);
  EXPECT_EQ(std::accumulate(t.burned_fraction.begin(), t.burned_fraction.end(), 0.0), 0.0);
  EXPECT_EQ(std::accumulate(t.heat_release_j_per_cad.begin(), t.heat_release_j_per_cad.end(), 0.0), 0.0);
}

}  // namespace
}  // namespace mgdd::engine
