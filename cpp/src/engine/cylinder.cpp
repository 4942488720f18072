#include "mgdd/engine/cylinder.hpp"

#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/gas.hpp"

namespace mgdd::engine {
namespace {

// What a crank angle outside its domain probably is.
std::string hint(std::string_view name, double value) {
  if (name == "ivc_cad" && value > 0.0) {
    return "; this looks like °bTDC: angles are °CA aTDC (firing TDC = 0, compression negative), so pass " +
           text(-value);
  }
  if (name == "evo_cad" && value > 180.0 && value <= 720.0) {
    return "; angles are counted from firing TDC = 0 (gas-exchange TDC = 360)";
  }
  return "";
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
  const GeometryParameters<double>& g = c.geometry;
  if (g.ivc_cad >= g.evo_cad) {  // before the bounds, whose message would hide the real mistake
    throw ParameterError("ivc_cad", g.ivc_cad,
                         "must be before evo_cad = " + text(g.evo_cad) +
                             "; angles are °CA aTDC (firing TDC = 0, compression negative)" +
                             (g.ivc_cad > 0.0 ? ", and " + text(g.ivc_cad) + " looks like °bTDC" : ""),
                         "°CA aTDC");
  }
  for (const auto& f : cylinder_fields<double>()) {
    const double value = f.in(c);
    if (f.info.domain.contains(value)) continue;
    throw ParameterError(f.info.name, value, requirement(f.info.domain) + hint(f.info.name, value), f.info.unit);
  }
  if (!(2.0 * g.connecting_rod_mm > g.stroke_mm)) {
    throw ParameterError("connecting_rod_mm", g.connecting_rod_mm,
                         "must be longer than the crank radius, half of stroke_mm = " + text(g.stroke_mm), "mm");
  }
  // gamma(T) must stay above 1 over the temperatures a cycle can meet.
  for (const double t : {250.0, 1000.0, 2000.0, 3500.0}) {
    const double gamma = gamma_at(c.gas, t);
    if (c.gas.gamma_model == GammaModel::constant || gamma > 1.0) continue;
    const bool linear = c.gas.gamma_model == GammaModel::linear;
    throw ParameterError(linear ? "gamma_linear_slope_per_k" : "gamma_polynomial_c1_per_k",
                         linear ? c.gas.gamma_linear_slope_per_k : c.gas.gamma_polynomial_c1_per_k,
                         "gamma is " + text(gamma) + " at " + text(t) + " K, must stay > 1");
  }
}

void validate(const OperatingPoint& p) {
  require_fields(operating_point_fields<double>(), p);
  if (p.burn_duration_cad) require_in(burn_duration_info, *p.burn_duration_cad);
  if (p.trapped_mass_g) require_in(trapped_mass_info, *p.trapped_mass_g);
  if (p.ivc_temperature_k) require_in(ivc_temperature_info, *p.ivc_temperature_k);
}

void validate_timing(std::string_view name, double value, const Cylinder& c) {
  const auto refuse = [&](const std::string& why) { throw ParameterError(name, value, why, "°CA aTDC"); };
  if (value > timing_upper_cad && value <= 90.0) {
    refuse("must be <= " + text(timing_upper_cad) +
           "; this looks like °bTDC: angles are °CA aTDC (firing TDC = 0, compression negative), so pass " +
           text(-value));
  }
  if (!(value >= timing_lower_cad && value <= timing_upper_cad)) {
    refuse("must be in [" + text(timing_lower_cad) + ", " + text(timing_upper_cad) +
           "] °CA aTDC (firing TDC = 0, compression negative)");
  }
  if (!(value >= c.geometry.ivc_cad && value < c.geometry.evo_cad)) {
    refuse("must lie in the closed part, from ivc_cad = " + text(c.geometry.ivc_cad) +
           " to evo_cad = " + text(c.geometry.evo_cad));
  }
}

Names<GammaModel> gamma_model_names() noexcept {
  return gamma_names;
}
Names<BurnShape> burn_shape_names() noexcept {
  return burn_names;
}
Names<WallHeatModel> wall_heat_model_names() noexcept {
  return wall_heat_names;
}
Names<IgnitionModel> ignition_model_names() noexcept {
  return ignition_names;
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
