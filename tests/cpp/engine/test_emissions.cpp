// NOx from T_max: the maps against each other, the oxygen factor, the correction of the soft sensor, the fit.
#include "mgdd/engine/emissions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/common/random.hpp"

namespace mgdd::engine {
namespace {

template <class Call>
std::string message_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(NoxModel, TheMapsAgreeInValueAndSlopeAtTheReference) {
  const NoxModel line{.map = NoxMap::affine_log}, arrhenius{.map = NoxMap::arrhenius};
  EXPECT_DOUBLE_EQ(line.ppm(1900.0), 1200.0);
  EXPECT_DOUBLE_EQ(arrhenius.ppm(1900.0), 1200.0);
  EXPECT_NEAR(line.ppm(1901.0) / line.ppm(1899.0), arrhenius.ppm(1901.0) / arrhenius.ppm(1899.0), 1e-8);
  EXPECT_GT(line.ppm(2200.0), 1.05 * arrhenius.ppm(2200.0));
  EXPECT_EQ(parse_name<NoxMap>("map", name_of(NoxMap::arrhenius)), NoxMap::arrhenius);
}

TEST(NoxModel, OxygenActsByItsPower) {
  NoxModel m{.intake_o2_fraction = 0.5 * air_o2_fraction, .o2_exponent = 3.0};
  EXPECT_DOUBLE_EQ(m.ppm(1900.0), 150.0);
  m.o2_exponent = 2.0;
  EXPECT_DOUBLE_EQ(m.ppm(1900.0), 300.0);
}

TEST(SoftSensor, ApproachesTheLogRatioAtItsRate) {
  const SoftSensor s{.correction_gain = 0.01};
  double bias = 0.0;
  for (int k = 0; k < 300; ++k)
    bias = s.next_bias(bias, 1300.0, 1000.0);
  EXPECT_NEAR(bias, std::log(1.3) * (1.0 - std::pow(0.99, 300)), 1e-12);
  EXPECT_NEAR(s.corrected_ppm(1900.0, std::log(1.3)), 1.3 * s.raw_ppm(1900.0), 1e-9);
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(s.next_bias(bias, bad, 1000.0), bias);
    EXPECT_EQ(s.next_bias(bias, 1000.0, bad), bias);
  }
}

TEST(SoftSensor, RefusesConstantsOutsideTheirDomain) {
  SoftSensor s;
  s.correction_gain = 1.5;
  EXPECT_EQ(message_of([&] { validate(s); }), "correction_gain = 1.5: must be in [0, 1]");
  s = {};
  s.model.intake_o2_fraction = 0.0;
  EXPECT_EQ(message_of([&] { validate(s); }), "intake_o2_fraction = 0: must be > 0 and <= 1");
  s = {};
  s.model.o2_exponent = -1.0;
  EXPECT_EQ(message_of([&] { validate(s); }), "o2_exponent = -1: must be in [0, 10]");
  s = {};
  s.model.proxy.reference_nox_ppm = -1.0;
  EXPECT_EQ(message_of([&] { validate(s); }), "reference_nox_ppm = -1 ppm: must be > 0 and finite");
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

TEST(NoxFit, RefusesDataThatAreNoSweep) {
  const std::vector<double> nox{900.0, 1100.0, 1500.0, 2000.0, 3000.0, 4200.0};
  const auto message = [](const std::vector<double>& t, const std::vector<double>& n) {
    return message_of([&] { fit_nox_proxy(t, n, NoxMap::affine_log); });
  };
  EXPECT_EQ(message(sweep_k, {1.0}), "nox_ppm has 1 entries: t_max_k has 6");
  EXPECT_EQ(message({1.0, 2.0, 3.0, 4.0}, {1.0, 2.0, 3.0, 4.0}), "t_max_k has 4 points: a fit needs at least 5");
  std::vector<double> bad = nox;
  bad[3] = 0.0;
  EXPECT_EQ(message(sweep_k, bad), "nox_ppm[3] = 0: must be > 0 and finite, leave such points out");
  EXPECT_EQ(message(std::vector<double>(6, 1900.0), nox),
            "t_max_k is 1900 at every point: a slope needs temperatures that differ");
  const std::vector<double> falling(nox.rbegin(), nox.rend());
  EXPECT_EQ(message(sweep_k, falling).substr(0, 35), "nox_ppm does not rise with t_max_k ");
  EXPECT_THROW(fit_nox_proxy(sweep_k, falling, NoxMap::affine_log), DataError);
  EXPECT_THROW(fit_nox_proxy(sweep_k, {}, NoxMap::affine_log), ShapeError);
  EXPECT_THROW(fit_nox_proxy(sweep_k, nox, NoxMap::affine_log, 0.0), ParameterError);
}

}  // namespace
}  // namespace mgdd::engine
