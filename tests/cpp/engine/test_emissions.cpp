// NOx from T_max: the oxygen factor, the correction of the soft sensor, the fit.
#include "mgdd/engine/emissions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/random.hpp"

namespace mgdd::engine {
namespace {

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
