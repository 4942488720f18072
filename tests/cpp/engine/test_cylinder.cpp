// Parameter records: every bound of every field, the timing window and the names of the variants.
#include "mgdd/engine/cylinder.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"

namespace mgdd::engine {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "accepted";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

template <class Record, class Fields>
void check_bounds(const Fields& fields) {
  const Record good;
  EXPECT_NO_THROW(validate(good));
  for (const auto& field : fields) {
    const Domain& domain = field.info.domain;
    const double below = domain.lower_open ? domain.lower : domain.lower - 1e-6;
    const double beyond = domain.upper * (domain.upper > 0.0 ? 1.0 + 1e-9 : 1.0) + 1e-6;
    for (const double bad : {std::nan(""), infinity, -infinity, below, beyond}) {
      Record record = good;
      field.in(record) = bad;
      const std::string message = refusal([&] { validate(record); });
      EXPECT_NE(message, "accepted") << field.info.name << " " << bad;
      const bool order = contains(message, "before evo_cad");  // IVC after EVO is said as such
      EXPECT_TRUE(contains(message, std::string(field.info.name) + " = ") || order) << message;
      EXPECT_TRUE(contains(message, "must be")) << message;
    }
    EXPECT_FALSE(field.info.unit.empty());
    EXPECT_FALSE(field.info.meaning.empty());
    EXPECT_LT(domain.lower, domain.upper);
  }
}

TEST(EngineCylinder, EveryFieldRefusesWhatIsOutsideItsDomain) {
  check_bounds<Cylinder>(cylinder_fields<double>());
  check_bounds<OperatingPoint>(operating_point_fields<double>());
  for (const double bad : {0.0, -1.0, std::nan(""), infinity, 1e9}) {
    OperatingPoint p;
    p.burn_duration_cad = bad;
    EXPECT_TRUE(contains(refusal([&] { validate(p); }), "burn_duration_cad = "));
    p = {};
    p.trapped_mass_g = bad;
    EXPECT_TRUE(contains(refusal([&] { validate(p); }), "trapped_mass_g = "));
  }
}

TEST(EngineCylinder, CrossRules) {
  Cylinder c;
  c.geometry.connecting_rod_mm = 43.0;
  EXPECT_TRUE(contains(refusal([&] { validate(c); }), "connecting_rod_mm = 43 mm: must be longer"));
  c = {};
  c.geometry.ivc_cad = 140.0;
  EXPECT_TRUE(contains(refusal([&] { validate(c); }), "looks like °bTDC"));
  c = {};
  c.gas.gamma_model = GammaModel::linear;
  c.gas.gamma_linear_slope_per_k = -1.9e-4;
  EXPECT_TRUE(contains(refusal([&] { validate(c); }), "must stay > 1"));
  c.gas.gamma_model = GammaModel::constant;  // then the slope is not in use
  EXPECT_EQ(refusal([&] { validate(c); }), "accepted");
}

TEST(EngineCylinder, TimingMustLieInItsWindowAndInTheClosedPart) {
  const Cylinder c;
  for (const double good : {-60.0, -6.0, 0.0, 20.0}) {
    EXPECT_NO_THROW(validate_timing("soc_cad", good, c));
  }
  for (const double bad : {-60.1, 91.0, infinity, -infinity, std::nan("")}) {
    EXPECT_TRUE(contains(refusal([&] { validate_timing("soc_cad", bad, c); }), "must be in [-60, 20]")) << bad;
  }
  const std::string message = refusal([&] { validate_timing("soc_cad", 25.0, c); });
  EXPECT_TRUE(contains(message, "soc_cad = 25 °CA aTDC")) << message;
  EXPECT_TRUE(contains(message, "°bTDC") && contains(message, "pass -25")) << message;
  Cylinder late = c;
  late.geometry.ivc_cad = -30.0;
  EXPECT_TRUE(contains(refusal([&] { validate_timing("soc_cad", -40.0, late); }), "closed part"));
}

TEST(EngineCylinder, NamesGoBothWays) {
  for (const char* name : {"triangle", "wiebe", "double_wiebe"}) {
    EXPECT_EQ(name_of(parse_name<BurnShape>("burn_shape", name)), name);
  }
  for (const char* name : {"constant", "linear", "polynomial"}) {
    EXPECT_EQ(name_of(parse_name<GammaModel>("gamma_model", name)), name);
  }
  for (const char* name : {"woschni", "hohenberg", "eichelberg"}) {
    EXPECT_EQ(name_of(parse_name<WallHeatModel>("wall_heat_model", name)), name);
  }
  for (const char* name : {"watson", "wolfer", "hardenberg_hase", "polynomial"}) {
    EXPECT_EQ(name_of(parse_name<IgnitionModel>("ignition_model", name)), name);
  }
  for (const char* name : {"trapezoid", "split", "tan2018_lagged", "euler"}) {
    EXPECT_EQ(name_of(parse_name<Integrator>("integrator", name)), name);
  }
  const std::string message = refusal([] { parse_name<Integrator>("integrator", "rk4"); });
  EXPECT_TRUE(contains(message, "integrator = 'rk4'") && contains(message, "split")) << message;
}

TEST(EngineCylinder, LiftKeepsEveryFieldAndAddsNoDerivative) {
  Cylinder c;
  c.burn.burn_shape = BurnShape::double_wiebe;
  c.wall_heat.wall_heat_model = WallHeatModel::hohenberg;
  c.gas.gamma_model = GammaModel::polynomial;
  c.ignition.ignition_model = IgnitionModel::wolfer;
  double value = 1.25;
  for (const auto& field : cylinder_fields<double>()) {
    field.in(c) = value *= 1.01;
  }
  const auto lifted = lift<Dual<4>>(c);
  constexpr auto fields = cylinder_fields<double>();
  constexpr auto duals = cylinder_fields<Dual<4>>();
  for (std::size_t i = 0; i < fields.size(); ++i) {
    EXPECT_EQ(duals[i].in(lifted), Dual<4>(fields[i].in(c))) << fields[i].info.name;
  }
  EXPECT_EQ(lift<double>(c), c);
}

}  // namespace
}  // namespace mgdd::engine
