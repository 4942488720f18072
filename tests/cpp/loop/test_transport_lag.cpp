// Transport delay and lag: step response in closed form, phase and gain of the discrete filter, the units of time.
#include "mgdd/loop/transport_lag.hpp"

#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"

namespace mgdd::loop {
namespace {

static_assert(noexcept(std::declval<TransportLag&>().step(0.0, 0, 1.0)));

TEST(TransportLag, StepResponseIsTheDelayedExponential) {
  for (const std::size_t delay : {0u, 1u, 38u}) {
    const double gain = SensorDynamics{.lag_cycles = 25.0}.gain_at(1500.0);
    TransportLag lag(40);
    lag.fill(2.0);
    for (int k = 0; k < 200; ++k) {
      const double y = lag.step(5.0, delay, gain);
      const double after = k + 1.0 - static_cast<double>(delay);
      EXPECT_NEAR(y, after > 0.0 ? 5.0 - 3.0 * std::exp(-after / 25.0) : 2.0, 1e-12) << k;
    }
  }
}

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

TEST(TransportLag, WithoutDelayAndLagItIsTheSignalItself) {
  TransportLag lag;
  for (const double x : {0.1, 0.7, -3.3})
    EXPECT_EQ(lag.step(x, 0, 1.0), x);
}

TEST(TransportLag, ADelayThatChangesReadsAnotherPlaceOfTheLine) {
  TransportLag lag(10);
  for (int k = 0; k < 20; ++k)
    lag.step(k, 4, 1.0);
  EXPECT_EQ(lag.step(20.0, 2, 1.0), 18.0);
  EXPECT_EQ(lag.step(21.0, 10, 1.0), 11.0);
}

struct Line {  // a lag as the part of a state
  TransportLag lag;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    TransportLag::visit(self.lag, v, "line");
  }
};

TEST(TransportLag, SavesAndRestoresBitForBit) {
  Line a{TransportLag(7)}, b{TransportLag(7)}, shorter{TransportLag(6)};
  a.lag.fill(1.0);
  for (int k = 0; k < 12; ++k)
    a.lag.step(std::sqrt(k), 5, 0.3);
  restore_state(b, save_state(a));
  for (int k = 0; k < 30; ++k)
    EXPECT_EQ(a.lag.step(std::cos(k), 6, 0.3), b.lag.step(std::cos(k), 6, 0.3));
  StateColumns bad = save_state(a);
  EXPECT_THROW(restore_state(shorter, bad), ParameterError);
  bad["line_at"] = {8.0};
  EXPECT_THROW(restore_state(b, bad), ParameterError);
  EXPECT_EQ(save_state(a), save_state(b));
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

TEST(SensorDynamics, RefusesValuesOutsideTheirDomain) {
  const auto message = [](const SensorDynamics& s) -> std::string {
    try {
      validate("analyser", s);
    } catch (const ParameterError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message({.delay_s = -1.0}), "analyser.delay_s = -1 s: must be in [0, 60]");
  EXPECT_EQ(message({.lag_s = 61.0}), "analyser.lag_s = 61 s: must be in [0, 60]");
  EXPECT_EQ(message({.noise_fraction = 0.3}), "analyser.noise_fraction = 0.3: must be in [0, 0.2]");
  EXPECT_EQ(message({.delay_cycles = -1}), "analyser.delay_cycles = -1: must be in [0, 100000]");
  EXPECT_EQ(message({.lag_cycles = 1e6}), "analyser.lag_cycles = 1000000: must be in [0, 100000]");
}

}  // namespace
}  // namespace mgdd::loop
