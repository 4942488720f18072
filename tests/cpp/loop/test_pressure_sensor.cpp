// Sensors of a bench: lags and delays of an analyser, the pressure that a sensor shows.
#include <complex>

#include "mgdd/common/units.hpp"
#include "mgdd/loop/pressure_sensor.hpp"
#include "mgdd/loop/transport_lag.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "support/bench_case.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

using test_support::bits_of;
using test_support::quiet_bench;
using test_support::wandering_soc_cad;

static_assert(noexcept(std::declval<VirtualEngine&>().pressure()));

std::vector<double> trace_of(VirtualEngine& bench, double soc_cad) {
  bench.step(soc_cad);
  const PressureTrace trace = bench.pressure();
  return {trace.pressure_bar.begin(), trace.pressure_bar.end()};
}

std::vector<double> true_trace(double soc_cad, double step_cad = 1.0, double scale = 0.5, double fuel_mg = 20.0) {
  engine::Cylinder cylinder;
  cylinder.wall_heat.wall_heat_scale = scale;
  engine::OperatingPoint point;
  point.fuel_mg = fuel_mg;
  const engine::CycleModel<double> model(cylinder, engine::crank_grid(cylinder, step_cad));
  engine::CycleWorkspace<double> work = model.make_workspace();
  model.run(model.charge(point), soc_cad, work);
  for (double& p : work.pressure_pa)
    p /= units::pa_per_bar;
  return work.pressure_pa;
}

TEST(PressureSensor, ExactItShowsTheCycleOnTheCrankGrid) {
  VirtualEngine bench(quiet_bench());
  EXPECT_TRUE(bench.pressure().pressure_bar.empty());
  for (const double soc : {-20.0, -6.0, 3.5})
    EXPECT_EQ(trace_of(bench, soc), true_trace(soc));
  const auto angles = bench.pressure().angle_cad;
  EXPECT_EQ(std::vector<double>(angles.begin(), angles.end()), engine::crank_grid({}));
  bench.reset();
  EXPECT_TRUE(bench.pressure().angle_cad.empty());
}

TEST(PressureSensor, GainAndADriftingOffsetAreThoseOfALine) {
  BenchSettings s = quiet_bench();
  s.pressure.gain_error = 0.02;
  s.pressure.offset_bar = -0.3;
  s.pressure.drift_bar_per_kcycle = 40.0;
  VirtualEngine bench(s);
  const std::vector<double> real = true_trace(-6.0);
  for (int cycle = 0; cycle < 3; ++cycle) {
    const std::vector<double> shown = trace_of(bench, -6.0);
    for (std::size_t k = 0; k < real.size(); ++k)
      EXPECT_NEAR(shown[k], 1.02 * real[k] - 0.3 + 0.04 * cycle, 1e-12) << cycle;
  }
}

// A finer grid, which holds the shifted angles, gives what must be read there; 4e-4 is the error of its step.
TEST(PressureSensor, ALateTdcShowsEachPressureLater) {
  const std::vector<double> fine = true_trace(-6.0, 0.0625);
  const auto at = [&](double angle) { return fine[static_cast<std::size_t>(std::lround((angle + 140.0) / 0.0625))]; };
  for (const double error : {0.5625, -0.6875, 2.0}) {
    BenchSettings s = quiet_bench();
    s.pressure.tdc_error_cad = error;
    s.step_cad = 0.25;
    VirtualEngine bench(s);
    bench.step(-6.0);
    const PressureTrace trace = bench.pressure();
    for (std::size_t k = 0; k < trace.angle_cad.size(); ++k) {
      const double angle = trace.angle_cad[k] - error;
      if (angle >= -140.0 && angle <= 130.0) {
        EXPECT_NEAR(trace.pressure_bar[k], at(angle), 4e-4 * at(angle)) << trace.angle_cad[k];
      }
    }
    EXPECT_NEAR(trace.pressure_bar.front(), 1.5, 0.02);
    EXPECT_NEAR(trace.pressure_bar.back(), 3.845, 0.15);
  }
}

TEST(PressureSensor, NoiseIsWhiteAndNothingElseHearsOfIt) {
  BenchSettings s;
  s.misfire_probability = 0.05;
  VirtualEngine silent(s);
  s.pressure.noise_bar = 0.4;
  s.pressure.tdc_error_cad = 0.3;
  VirtualEngine noisy(s);
  s.pressure.noise_bar = 0.0;
  VirtualEngine clean(s);
  double square = 0.0, neighbour = 0.0, next_cycle = 0.0;
  std::vector<double> before;
  std::size_t n = 0;
  for (int k = 0; k < 100; ++k) {
    const double soc = wandering_soc_cad(k);
    EXPECT_EQ(bits_of(silent.step(soc)), bits_of(noisy.step(soc)));
    clean.step(soc);
    const auto a = noisy.pressure().pressure_bar, b = clean.pressure().pressure_bar;
    std::vector<double> noise(a.size());
    std::transform(a.begin(), a.end(), b.begin(), noise.begin(), std::minus<>());
    for (std::size_t i = 1; i < noise.size(); ++i) {
      square += noise[i] * noise[i];
      neighbour += noise[i] * noise[i - 1];
      if (!before.empty()) next_cycle += noise[i] * before[i];
      ++n;
    }
    before = noise;
  }
  EXPECT_NEAR(std::sqrt(square / static_cast<double>(n)), 0.4, 0.01);
  EXPECT_NEAR(neighbour / square, 0.0, 0.025);
  EXPECT_NEAR(next_cycle / square, 0.0, 0.025);
}

TEST(PressureSensor, ShowsTheBurnOfTheCycleWithItsScatterDriftAndMisfires) {
  BenchSettings s = quiet_bench();
  s.soc_scatter_cad = 0.8;
  s.wall_heat_drift_per_kcycle = 10.0;
  s.misfire_probability = 0.3;
  VirtualEngine bench(s);
  int misfires = 0;
  for (int k = 0; k < 20; ++k) {
    const BenchCycle c = bench.step(-6.0);
    const auto shown = bench.pressure().pressure_bar;
    misfires += c.misfire ? 1 : 0;
    const std::vector<double> real = true_trace(c.soc_cad, 1.0, 0.5 + 0.01 * k, c.misfire ? 0.0 : 20.0);
    EXPECT_EQ(std::vector<double>(shown.begin(), shown.end()), real) << k;
  }
  EXPECT_GT(misfires, 2);
}

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
