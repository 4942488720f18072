// Transport delay and lag: phase and gain of the discrete filter, a delay that changes, the units of time.
#include "mgdd/loop/transport_lag.hpp"

#include <cmath>
#include <complex>
#include <numbers>

#include <gtest/gtest.h>

namespace mgdd::loop {
namespace {

static_assert(noexcept(std::declval<TransportLag&>().step(0.0, 0, 1.0)));

// Response to sin(omega k) after the start has died away, as amplitude and lag in degrees.
std::pair<double, double> response(std::size_t delay, double tau, int period) {
  const double omega = 2.0 * std::numbers::pi / period;
  const double gain = SensorDynamics{.lag_cycles = tau}.gain_at(1500.0);
  TransportLag lag(delay);
  std::complex<double> sum;
  const int settle = 100 * period, span = 100 * period;
  for (int k = 0; k < settle + span; ++k) {
    const double y = lag.step(std::sin(omega * k), delay, gain);
    if (k >= settle) sum += y * std::exp(std::complex<double>(0.0, -omega * k)) * 2.0 / static_cast<double>(span);
  }
  const double lead = std::arg(sum * std::complex<double>(0.0, 1.0)) * 180.0 / std::numbers::pi;
  return {std::abs(sum), std::fmod(720.0 - lead, 360.0)};
}

TEST(TransportLag, PhaseIsThatOfTheDiscreteFilter) {
  EXPECT_NEAR(response(42, 25.0, 10).second, 140.5, 0.1);
  EXPECT_NEAR(response(34, 25.0, 10).second, 212.5, 0.1);
  for (const int period : {10, 60, 120}) {
    const double omega = 2.0 * std::numbers::pi / period, g = 1.0 - std::exp(-1.0 / 25.0);
    const auto filter = g / (1.0 - (1.0 - g) * std::exp(std::complex<double>(0.0, -omega)));
    EXPECT_NEAR(response(38, 25.0, period).first, std::abs(filter), 1e-9) << period;
  }
}

TEST(TransportLag, ADelayThatChangesReadsAnotherPlaceOfTheLine) {
  TransportLag lag(10);
  for (int k = 0; k < 20; ++k)
    lag.step(k, 4, 1.0);
  EXPECT_EQ(lag.step(20.0, 2, 1.0), 18.0);
  EXPECT_EQ(lag.step(21.0, 10, 1.0), 11.0);
}

TEST(SensorDynamics, SecondsBecomeCyclesAtTheSpeed) {
  const SensorDynamics s{.delay_s = 3.0, .lag_s = 2.0};
  EXPECT_EQ(s.delay_at(1500.0), 38u);
  EXPECT_EQ(s.delay_at(3000.0), 75u);
  EXPECT_DOUBLE_EQ(s.gain_at(1500.0), -std::expm1(-1.0 / 25.0));
  EXPECT_EQ(SensorDynamics{}.gain_at(1500.0), 1.0);
  const SensorDynamics fixed{.delay_s = 3.0, .lag_s = 2.0, .delay_cycles = 42, .lag_cycles = 0.0};
  EXPECT_EQ(fixed.delay_at(3000.0), 42u);
  EXPECT_EQ(fixed.gain_at(3000.0), 1.0);
}

}  // namespace
}  // namespace mgdd::loop
