// Figures of a cycle and what is made of them: peaks, ringing, the performance, nitric oxide by its proxies.
#include "mgdd/common/random.hpp"
#include "mgdd/engine/emissions.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/engine/performance.hpp"
#include "support/engine_case.hpp"
#include "support/test.hpp"

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

using enum PerformanceSignal;

PerformanceSignals example() {
  PerformanceSignals s;
  s[efficiency_percent] = 56.0;
  s[imep_gross_bar] = 9.6;
  s[imep_closed_bar] = 9.4;
  s[nox_ppm] = 1500.0;
  s[p_max_bar] = 110.0;
  s[dp_max_bar_per_cad] = 12.0;
  s[t_max_k] = 1950.0;
  return s;
}

static_assert(noexcept(std::declval<const Performance&>().components(std::declval<const PerformanceSignals&>(),
                                                                     std::span<double>())));
static_assert(std::is_trivially_copyable_v<Performance>);

TEST(Performance, EverySignalReachesItsTerm) {
  const PerformanceSignals s = example();
  for (std::size_t i = 0; i < performance_signal_count; ++i) {
    const auto signal = static_cast<PerformanceSignal>(i);
    EXPECT_DOUBLE_EQ((Performance{{.signal = signal, .weight = 3.0, .reference = 2.0}}.value(s)), 1.5 * s.values[i]);
    EXPECT_EQ(parse_name<PerformanceSignal>("signal", name_of(signal)), signal);
    EXPECT_NE(unit_of(signal), "unknown");
  }
}

TEST(Performance, AHingeIsZeroToItsLimitAndQuadraticAbove) {
  const PerformanceTerm hinge{.signal = dp_max_bar_per_cad, .weight = -2.0, .reference = 7.0, .above = 10.0};
  EXPECT_EQ(hinge.value(4.0), 0.0);
  EXPECT_EQ(hinge.value(10.0), 0.0);
  EXPECT_DOUBLE_EQ(hinge.value(12.0), -2.0 * 0.04);
  EXPECT_DOUBLE_EQ(hinge.value(20.0), -2.0);
}

TEST(NoxModel, OxygenActsByItsPower) {
  NoxModel m{.intake_o2_fraction = 0.5 * air_o2_fraction, .o2_exponent = 3.0};
  EXPECT_DOUBLE_EQ(m.ppm(1900.0), 150.0);
  m.o2_exponent = 2.0;
  EXPECT_DOUBLE_EQ(m.ppm(1900.0), 300.0);
}

const std::vector<double> sweep_k{1834.0, 1881.0, 1959.0, 2026.0, 2126.0, 2236.0};

TEST(NoxFit, RecoversExactDataOfBothMapsAtAnyReference) {
  const NoxProxy truth{1950.0, 800.0, 21000.0};
  for (const NoxMap map : {NoxMap::affine_log, NoxMap::arrhenius}) {
    const NoxModel model{.proxy = truth, .map = map};
    std::vector<double> nox(sweep_k.size());
    std::transform(sweep_k.begin(), sweep_k.end(), nox.begin(), [&](double t) { return model.ppm(t); });
    const NoxFit fit = fit_nox_proxy(sweep_k, nox, map, 1950.0);
    EXPECT_NEAR(fit.proxy.activation_temperature_k, 21000.0, 1e-6);
    EXPECT_NEAR(fit.proxy.reference_nox_ppm, 800.0, 1e-8);
    EXPECT_LT(fit.residual_ln, 1e-12);
    EXPECT_EQ(fit.points, sweep_k.size());
    const NoxFit moved = fit_nox_proxy(sweep_k, nox, NoxMap::arrhenius, 1800.0);
    const NoxFit there = fit_nox_proxy(sweep_k, nox, NoxMap::arrhenius, 2100.0);
    EXPECT_NEAR(moved.proxy.arrhenius_ppm(2000.0), there.proxy.arrhenius_ppm(2000.0), 1e-6);
  }
}

// Standard errors against the scatter of the estimates over many noisy sweeps.
TEST(NoxFit, StandardErrorsAreThoseOfRepeatedSweeps) {
  constexpr int sweeps = 4000;
  constexpr double sigma = 0.05;
  const NoxModel model{.map = NoxMap::arrhenius};
  double b_sum = 0.0, b_squares = 0.0, n_sum = 0.0, n_squares = 0.0, b_stderr = 0.0, n_stderr = 0.0, spread = 0.0;
  for (int k = 0; k < sweeps; ++k) {
    std::vector<double> nox(sweep_k.size());
    for (std::size_t i = 0; i < nox.size(); ++i)
      nox[i] = model.ppm(sweep_k[i]) * std::exp(sigma * random::normal(1, i, static_cast<std::uint64_t>(k)));
    const NoxFit fit = fit_nox_proxy(sweep_k, nox, NoxMap::arrhenius);
    b_sum += fit.proxy.activation_temperature_k / sweeps;
    b_squares += std::pow(fit.proxy.activation_temperature_k - 16000.0, 2) / sweeps;
    n_sum += fit.proxy.reference_nox_ppm / sweeps;
    n_squares += std::pow(fit.proxy.reference_nox_ppm - 1200.0, 2) / sweeps;
    b_stderr += std::pow(fit.activation_temperature_stderr_k, 2) / sweeps;
    n_stderr += std::pow(fit.reference_nox_stderr_ppm, 2) / sweeps;
    spread += fit.residual_ln * fit.residual_ln / sweeps;
  }
  EXPECT_NEAR(b_sum, 16000.0, 4.0 * std::sqrt(b_squares / sweeps));
  EXPECT_NEAR(n_sum, 1200.0, 4.0 * std::sqrt(n_squares / sweeps) + 1.0);
  EXPECT_NEAR(b_stderr / b_squares, 1.0, 0.1);
  EXPECT_NEAR(n_stderr / n_squares, 1.0, 0.1);
  EXPECT_NEAR(spread, sigma * sigma, 0.05 * sigma * sigma);
}

}  // namespace
}  // namespace mgdd::engine
