#include "mgdd/engine/cylinder.hpp"

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
  require_fields(fields_of(p), p);
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

}  // namespace mgdd::engine
