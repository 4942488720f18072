// Numbers of the engine: what a user gets who says nothing, which bounds belong to the domain, rules between fields.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/emissions.hpp"
#include "mgdd/engine/ignition.hpp"
#include "mgdd/engine/performance.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"
#include "mgdd/engine/sensitivity.hpp"
#include "support/preset_file.hpp"

namespace mgdd::engine {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// A change of the preset is a breaking change.
TEST(EngineNumbers, DefaultsAreTheLightDutyDiesel) {
  const Cylinder c;
  test_support::expect_preset(c, cylinder_fields<double>(),
                              {{"burn_shape", name_of(c.burn.burn_shape)},
                               {"gamma_model", name_of(c.gas.gamma_model)},
                               {"wall_heat_model", name_of(c.wall_heat.wall_heat_model)},
                               {"ignition_model", name_of(c.ignition.ignition_model)}},
                              "puma_single", "cylinder");
  test_support::expect_preset(OperatingPoint{}, operating_point_fields<double>(), {}, "puma_single", "point");
  EXPECT_FALSE(OperatingPoint{}.burn_duration_cad.has_value());
  EXPECT_FALSE(OperatingPoint{}.trapped_mass_g.has_value());
  EXPECT_FALSE(OperatingPoint{}.ivc_temperature_k.has_value());
}

// --- what is allowed ------------------------------------------------------------------------------------------

template <class Record>
void expect_edges(const auto& fields) {
  for (const auto& field : fields) {
    const auto message = [&](double value) {
      Record record;
      field.in(record) = value;
      return refusal([&] { validate(record); });
    };
    const std::string bound = std::string(field.info.name) + " = ";
    const auto outside = [&](double value) {
      const std::string told = message(value);
      return told.rfind(bound, 0) == 0 &&
             (told.find("must be >") != std::string::npos || told.find("must be in [") != std::string::npos);
    };
    EXPECT_FALSE(outside(field.info.domain.upper)) << field.info.name;
    const double upper = field.info.domain.upper;
    const double past = upper == 0.0 ? 1e-12 : upper + 1e-12 * std::abs(upper);
    EXPECT_TRUE(outside(past)) << field.info.name;
    const bool order = field.info.name == "evo_cad";  // then IVC stands after EVO, which is said as such
    EXPECT_EQ(outside(field.info.domain.lower), field.info.domain.lower_open || order) << field.info.name;
  }
}

TEST(EngineNumbers, BoundsBelongToTheDomainWhereTheySay) {
  expect_edges<Cylinder>(cylinder_fields<double>());
  expect_edges<OperatingPoint>(operating_point_fields<double>());
  for (const auto& [member, info] : {std::pair{&OperatingPoint::burn_duration_cad, burn_duration_info},
                                     {&OperatingPoint::trapped_mass_g, trapped_mass_info},
                                     {&OperatingPoint::ivc_temperature_k, ivc_temperature_info}}) {
    OperatingPoint p;
    p.*member = info.domain.upper;
    EXPECT_EQ(refusal([&] { validate(p); }), "");
    p.*member = info.domain.upper * 1.001;
    EXPECT_NE(refusal([&] { validate(p); }).find(std::string(info.name) + " = "), std::string::npos);
    p.*member = 0.0;
    EXPECT_NE(refusal([&] { validate(p); }), "");
  }
}

TEST(EngineNumbers, GammaStaysAboveOneInEveryModelThatUsesIt) {
  Cylinder c;
  c.gas.gamma_model = GammaModel::polynomial;
  EXPECT_EQ(refusal([&] { validate(c); }), "");
  c.gas.gamma_polynomial_c1_per_k = -2e-4;
  EXPECT_NE(refusal([&] { validate(c); }).find("gamma_polynomial_c1_per_k = -0.0002"), std::string::npos);
  c.gas.gamma_model = GammaModel::linear;
  EXPECT_EQ(refusal([&] { validate(c); }), "") << "the polynomial is not in use";
  c.gas.gamma_linear_slope_per_k = 1e-4;
  EXPECT_EQ(refusal([&] { validate(c); }), "") << "it may rise";
  c.gas.gamma_linear_300k = 1.004;
  EXPECT_NE(refusal([&] { validate(c); }).find("is 0.999 at 250 K"), std::string::npos) << "the cold end counts";
}

TEST(EngineNumbers, ACycleRefusesEachOfItsInputs) {
  const Cylinder good;
  const OperatingPoint point;
  const auto cycle = [&](const Cylinder& c, const OperatingPoint& p, double soc) {
    return refusal([&] { validate_cycle(c, p, soc); });
  };
  EXPECT_EQ(cycle(good, point, -6.0), "");
  Cylinder c = good;
  c.geometry.bore_mm = -1.0;
  EXPECT_EQ(cycle(c, point, -6.0).rfind("bore_mm = -1", 0), 0U);
  OperatingPoint p = point;
  p.speed_rpm = 0.0;
  EXPECT_EQ(cycle(good, p, -6.0).rfind("speed_rpm = 0", 0), 0U);
  EXPECT_EQ(cycle(good, point, 21.0).rfind("soc_cad = 21", 0), 0U);
  c = good;
  c.gas.ivc_pressure_rise_kpa = -150.0;
  EXPECT_EQ(cycle(c, point, -6.0).rfind("ivc_pressure_rise_kpa = -150 kPa: p(IVC) is 0 kPa", 0), 0U);
  c.gas.ivc_pressure_rise_kpa = -149.9;
  EXPECT_EQ(cycle(c, point, -6.0), "");
  c = good;
  c.burn.burn_shape = BurnShape::double_wiebe;
  c.geometry.ivc_cad = -50.0;
  c.burn.second_delay_cad = -5.0;
  EXPECT_EQ(cycle(c, point, -45.0), "") << "at IVC it may start";
  EXPECT_EQ(cycle(c, point, -45.1).rfind("second_delay_cad = -5", 0), 0U);
  EXPECT_EQ(crank_grid(good, 0.001).size(), 270001U);
  EXPECT_EQ(crank_grid(good, 5.0).size(), 55U);
  const std::vector<double> grid = crank_grid(good, 0.7);
  EXPECT_EQ(grid.size(), 387U);
  EXPECT_DOUBLE_EQ(grid[100], -70.0);
  EXPECT_EQ(crank_grid(good, 0.9 * (1.0 + 1e-12)).size(), 301U) << "a remainder from rounding makes no step";
}

TEST(EngineNumbers, TimingsHaveTheirEdges) {
  Cylinder c;
  c.geometry.ivc_cad = -50.0;
  c.geometry.evo_cad = 15.0;
  const auto at = [&](double value) { return refusal([&] { validate_timing("soi_cad", value, c); }); };
  EXPECT_EQ(at(-50.0), "");
  EXPECT_NE(at(-50.1).find("closed part, from ivc_cad = -50 to evo_cad = 15"), std::string::npos);
  EXPECT_EQ(at(14.9), "");
  EXPECT_NE(at(15.0).find("closed part"), std::string::npos);
  EXPECT_NE(at(90.0).find("looks like °bTDC"), std::string::npos);
  EXPECT_EQ(at(90.1).find("looks like °bTDC"), std::string::npos);
  EXPECT_NE(at(90.1).find("must be in [-60, 20]"), std::string::npos);
}

TEST(EngineNumbers, EmissionsRefuseEachOfTheirs) {
  const auto refused = [](auto change, const std::string& part) {
    SoftSensor s;
    EXPECT_NO_THROW(validate(s));
    change(s);
    EXPECT_EQ(refusal([&] { validate(s); }).rfind(part, 0), 0U) << part;
  };
  refused([](SoftSensor& s) { s.model.proxy.reference_temperature_k = 0.0; }, "reference_temperature_k = 0");
  refused([](SoftSensor& s) { s.model.proxy.reference_nox_ppm = infinity; }, "reference_nox_ppm = inf");
  refused([](SoftSensor& s) { s.model.proxy.activation_temperature_k = -1.0; }, "activation_temperature_k = -1");
  refused([](SoftSensor& s) { s.model.intake_o2_fraction = 1.01; }, "intake_o2_fraction = 1.01");
  refused([](SoftSensor& s) { s.model.o2_exponent = 10.1; }, "o2_exponent = 10.1");
  refused([](SoftSensor& s) { s.correction_gain = -0.1; }, "correction_gain = -0.1");
  SoftSensor edge;
  edge.model.intake_o2_fraction = 1.0;
  edge.correction_gain = 1.0;
  EXPECT_EQ(refusal([&] { validate(edge); }), "");

  const std::vector<double> t{1800.0, 1900.0, 2000.0, 2100.0, 2200.0}, nox{700.0, 1200.0, 1900.0, 2900.0, 4100.0};
  const auto fit = [&](std::vector<double> temperatures, std::vector<double> values, double reference = 1900.0) {
    return refusal([&] { fit_nox_proxy(temperatures, values, NoxMap::arrhenius, reference); });
  };
  EXPECT_EQ(fit(t, nox), "") << "five points are enough";
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    auto column = t;
    column[2] = bad;
    EXPECT_EQ(fit(column, nox).rfind("t_max_k[2] = ", 0), 0U) << bad;
    column = nox;
    column[4] = bad;
    EXPECT_EQ(fit(t, column).rfind("nox_ppm[4] = ", 0), 0U) << bad;
    EXPECT_EQ(fit(t, nox, bad).rfind("reference_temperature_k = ", 0), 0U) << bad;
  }
}

// Two points on each side of a line: slope, level and spread by hand.
TEST(EngineNumbers, TheFitOfNoxIsThatOfTheBook) {
  const double t0 = 1950.0, b = 15000.0, level = 900.0;
  const std::vector<double> off{0.02, -0.05, 0.01, 0.06, -0.03, 0.0};
  std::vector<double> t, nox;
  double xx = 0.0, x_mean = 0.0;
  for (std::size_t i = 0; i < off.size(); ++i) {
    t.push_back(1800.0 + 70.0 * static_cast<double>(i));
    x_mean += (1.0 / t0 - 1.0 / t[i]) / 6.0;
  }
  double y_mean = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < off.size(); ++i) {
    const double x = 1.0 / t0 - 1.0 / t[i];
    nox.push_back(level * std::exp(b * x + off[i]));
    xx += (x - x_mean) * (x - x_mean);
    xy += (x - x_mean) * std::log(nox[i]);
    y_mean += std::log(nox[i]) / 6.0;
  }
  const double slope = xy / xx;
  double squares = 0.0;
  for (std::size_t i = 0; i < off.size(); ++i)
    squares += std::pow(std::log(nox[i]) - y_mean - slope * (1.0 / t0 - 1.0 / t[i] - x_mean), 2);
  const NoxFit fit = fit_nox_proxy(t, nox, NoxMap::arrhenius, t0);
  const double sd = std::sqrt(squares / 4.0);
  EXPECT_EQ(fit.map, NoxMap::arrhenius);
  EXPECT_EQ(fit.proxy.reference_temperature_k, t0);
  EXPECT_NEAR(fit.proxy.activation_temperature_k, slope, 1e-6);
  EXPECT_NEAR(fit.proxy.reference_nox_ppm, std::exp(y_mean - slope * x_mean), 1e-8);
  EXPECT_NEAR(fit.residual_ln, sd, 1e-12);
  EXPECT_NEAR(fit.activation_temperature_stderr_k, sd / std::sqrt(xx), 1e-6);
  EXPECT_NEAR(fit.reference_nox_stderr_ppm,
              fit.proxy.reference_nox_ppm * sd * std::sqrt(1.0 / 6.0 + x_mean * x_mean / xx), 1e-8);
}

}  // namespace
}  // namespace mgdd::engine
