#include "mgdd/engine/cylinder.hpp"

#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::engine {
namespace {

void check(const FieldInfo& info, double value) {
  const bool above = info.lower_open ? value > info.lower : value >= info.lower;
  if (above && value <= info.upper) return;  // NaN fails both comparisons
  std::string bound = (info.lower_open ? "must be > " : "must be >= ") + text(info.lower);
  if (info.upper < unbounded) bound += " and <= " + text(info.upper);
  if (info.name == "ivc_cad" && value > 0.0) {
    bound +=
        "; this looks like °bTDC: angles are °CA aTDC (firing TDC = 0, compression negative), so pass " + text(-value);
  }
  if (info.name == "evo_cad" && value > 180.0 && value <= 720.0) {
    bound += "; angles are counted from firing TDC = 0 (gas-exchange TDC = 360)";
  }
  throw ParameterError(info.name, value, bound, info.unit);
}

constexpr std::pair<GammaModel, std::string_view> gamma_names[] = {
    {GammaModel::constant, "constant"}, {GammaModel::linear, "linear"}, {GammaModel::polynomial, "polynomial"}};
constexpr std::pair<BurnShape, std::string_view> burn_names[] = {
    {BurnShape::triangle, "triangle"}, {BurnShape::wiebe, "wiebe"}, {BurnShape::double_wiebe, "double_wiebe"}};
constexpr std::pair<WallHeatModel, std::string_view> wall_heat_names[] = {{WallHeatModel::woschni, "woschni"},
                                                                          {WallHeatModel::hohenberg, "hohenberg"}};
constexpr std::pair<IgnitionModel, std::string_view> ignition_names[] = {
    {IgnitionModel::watson, "watson"},
    {IgnitionModel::wolfer, "wolfer"},
    {IgnitionModel::hardenberg_hase, "hardenberg_hase"},
    {IgnitionModel::polynomial, "polynomial"}};
constexpr std::pair<Integrator, std::string_view> integrator_names[] = {{Integrator::trapezoid, "trapezoid"},
                                                                        {Integrator::split, "split"},
                                                                        {Integrator::seed, "seed"},
                                                                        {Integrator::euler, "euler"}};

}  // namespace

void validate(const Cylinder& c) {
  if (c.ivc_cad >= c.evo_cad) {  // before the bounds, whose message would hide the real mistake
    throw ParameterError("ivc_cad = " + text(c.ivc_cad) + " °CA aTDC: must be before evo_cad = " + text(c.evo_cad) +
                         "; angles are °CA aTDC (firing TDC = 0, compression negative)" +
                         (c.ivc_cad > 0.0 ? ", and " + text(c.ivc_cad) + " looks like °bTDC" : ""));
  }
  for (const auto& field : cylinder_fields<double>())
    check(field.info, c.*(field.member));
  if (!(2.0 * c.connecting_rod_mm > c.stroke_mm)) {
    throw ParameterError("connecting_rod_mm = " + text(c.connecting_rod_mm) +
                         " mm: must be longer than the crank radius, half of stroke_mm = " + text(c.stroke_mm));
  }
  // gamma(T) must stay above 1 over the temperatures a cycle can meet.
  for (const double t : {250.0, 1000.0, 2000.0, 3500.0}) {
    const double linear = c.gamma_linear_300k + c.gamma_linear_slope_per_k * (t - 300.0);
    const double poly = c.gamma_polynomial_c0 + t * (c.gamma_polynomial_c1_per_k + t * c.gamma_polynomial_c2_per_k2);
    if (c.gamma_model == GammaModel::linear && !(linear > 1.0)) {
      throw ParameterError("gamma_linear_slope_per_k = " + text(c.gamma_linear_slope_per_k) + ": gamma is " +
                           text(linear) + " at " + text(t) + " K, must stay > 1");
    }
    if (c.gamma_model == GammaModel::polynomial && !(poly > 1.0)) {
      throw ParameterError("gamma_polynomial_c1_per_k = " + text(c.gamma_polynomial_c1_per_k) + ": gamma is " +
                           text(poly) + " at " + text(t) + " K, must stay > 1");
    }
  }
}

void validate(const OperatingPoint& p) {
  for (const auto& field : operating_point_fields<double>())
    check(field.info, p.*(field.member));
  if (p.burn_duration_cad) check(burn_duration_info, *p.burn_duration_cad);
  if (p.trapped_mass_g) check(trapped_mass_info, *p.trapped_mass_g);
}

void validate_timing(std::string_view name, double value, const Cylinder& c) {
  const std::string given = std::string(name) + " = " + text(value) + " °CA aTDC";
  if (value > timing_upper_cad && value <= 90.0) {
    throw ParameterError(given + ": must be <= " + text(timing_upper_cad) +
                         "; this looks like °bTDC: angles are °CA aTDC (firing TDC = 0, compression negative), so "
                         "pass " +
                         text(-value));
  }
  if (!(value >= timing_lower_cad && value <= timing_upper_cad)) {
    throw ParameterError(given + ": must be in [" + text(timing_lower_cad) + ", " + text(timing_upper_cad) +
                         "] °CA aTDC (firing TDC = 0, compression negative)");
  }
  if (!(value >= c.ivc_cad && value < c.evo_cad)) {
    throw ParameterError(given + ": must lie in the closed part, from ivc_cad = " + text(c.ivc_cad) +
                         " to evo_cad = " + text(c.evo_cad));
  }
}

std::string_view to_string(GammaModel v) noexcept {
  return name_of<GammaModel>(gamma_names, v);
}
std::string_view to_string(BurnShape v) noexcept {
  return name_of<BurnShape>(burn_names, v);
}
std::string_view to_string(WallHeatModel v) noexcept {
  return name_of<WallHeatModel>(wall_heat_names, v);
}
std::string_view to_string(IgnitionModel v) noexcept {
  return name_of<IgnitionModel>(ignition_names, v);
}
std::string_view to_string(Integrator v) noexcept {
  return name_of<Integrator>(integrator_names, v);
}
GammaModel parse_gamma_model(std::string_view t) {
  return parse_name<GammaModel>(gamma_names, "gamma_model", t);
}
BurnShape parse_burn_shape(std::string_view t) {
  return parse_name<BurnShape>(burn_names, "burn_shape", t);
}
WallHeatModel parse_wall_heat_model(std::string_view t) {
  return parse_name<WallHeatModel>(wall_heat_names, "wall_heat_model", t);
}
IgnitionModel parse_ignition_model(std::string_view t) {
  return parse_name<IgnitionModel>(ignition_names, "ignition_model", t);
}
Integrator parse_integrator(std::string_view t) {
  return parse_name<Integrator>(integrator_names, "integrator", t);
}

}  // namespace mgdd::engine
