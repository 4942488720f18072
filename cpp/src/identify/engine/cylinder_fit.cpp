#include "mgdd/identify/engine/cylinder_fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"
#include "mgdd/identify/engine/cylinder_residual.hpp"

namespace mgdd::identify {
namespace {

bool places_grid(std::string_view name) {
  return name == "ivc_cad" || name == "evo_cad";
}
bool is_load_field(std::string_view name) {
  const auto fields = load_fields<double>();
  return std::any_of(fields.begin(), fields.end(), [&](const auto& f) { return f.info.name == name; });
}

struct Free {
  std::vector<std::size_t> common, load;
};

Free resolve(const std::vector<std::string>& names) {
  Free free;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), names[i]) !=
        names.begin() + static_cast<std::ptrdiff_t>(i)) {
      throw about("free", ParameterError("free: '" + names[i] + "' is named twice"));
    }
    bool found = false;
    const auto loads = load_fields<double>();
    for (std::size_t k = 0; k < loads.size(); ++k) {
      if (loads[k].info.name == names[i]) free.load.push_back(k), found = true;
    }
    const auto common = engine::cylinder_fields<double>();
    for (std::size_t k = 0; k < common.size() && !found; ++k) {
      if (common[k].info.name == names[i] && !places_grid(names[i])) free.common.push_back(k), found = true;
    }
    if (found) continue;
    std::string valid;
    for (const std::string& n : load_parameters())
      valid.append(valid.empty() ? "" : ", ").append(n);
    throw about("free",
                ParameterError("free: '" + names[i] + "' is not a parameter of a calibration; per load: " + valid +
                               "; for all loads: any field of the cylinder except ivc_cad and evo_cad"));
  }
  if (names.empty()) throw about("free", ParameterError("free is empty: name at least one parameter"));
  return free;
}

// The calibration offline searches wall heat up to 2.5 times the textbook law, everything else in its domain.
optimize::Parameter common_parameter(FieldInfo info) {
  if (info.name == "wall_heat_scale") info.domain = closed(0.0, wall_heat_scale_upper);
  return optimize::parameter_of(info, std::string(info.name));
}

std::vector<optimize::Parameter> describe(const Free& free, const std::vector<MeasuredCycle>& traces) {
  std::vector<optimize::Parameter> out;
  for (const std::size_t k : free.common)
    out.push_back(common_parameter(engine::cylinder_fields<double>()[k].info));
  for (const MeasuredCycle& trace : traces) {
    for (const std::size_t k : free.load) {
      const FieldInfo info = load_fields<double>()[k].info;
      out.push_back(optimize::parameter_of(info, std::string(info.name) + "[" + trace.label + "]"));
    }
  }
  return out;
}

// A bound that no parameter bears would be a limit that nobody keeps, so it is refused.
void narrow(std::vector<optimize::Parameter>& parameters, const std::vector<SearchBound>& bounds) {
  for (const SearchBound& bound : bounds) {
    bool found = false;
    for (optimize::Parameter& p : parameters) {
      if (p.name != bound.name && p.name.substr(0, p.name.find('[')) != bound.name) continue;
      found = true;
      p.lower = std::max(p.lower, bound.lower);
      p.upper = std::min(p.upper, bound.upper);
      if (!(p.lower < p.upper)) {
        throw about("bounds", ParameterError("bounds: " + bound.name + " from " + text(bound.lower) + " to " +
                                             text(bound.upper) + " leaves nothing of the parameter's own domain"));
      }
    }
    if (!found) {
      throw about("bounds", ParameterError("bounds: '" + bound.name + "' is not free in this fit: free it, or leave " +
                                           "its bound out"));
    }
  }
}

void check_inputs(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder,
                  const std::vector<LoadBurn>& start, const CylinderFitOptions& options) {
  engine::validate(cylinder);
  if (traces.empty()) throw about("traces", ShapeError("traces is empty: a calibration needs at least one"));
  if (start.size() != traces.size()) {
    throw about("start", ShapeError("start has " + std::to_string(start.size()) + " entries for " +
                                    std::to_string(traces.size()) + " traces"));
  }
  require_within("step_cad", options.step_cad, engine::step_lower_cad, engine::step_upper_cad, "°CA");
  for (std::size_t t = 0; t < start.size(); ++t) {
    for (const auto& field : load_fields<double>()) {
      const std::string name = "start of " + std::string(field.info.name) + "[" + traces[t].label + "]";
      require_in(field.info.domain, name, field.in(start[t]));
    }
  }
  for (const MeasuredCycle& trace : traces) {
    engine::validate(trace.point);
    engine::check_trace(trace.angle_cad, trace.pressure_bar);
    if (trace.angle_cad.front() < cylinder.geometry.ivc_cad - 1e-9 ||
        trace.angle_cad.back() > cylinder.geometry.evo_cad + 1e-9) {
      throw DataError("trace '" + trace.label + "' spans " + text(trace.angle_cad.front()) + " to " +
                      text(trace.angle_cad.back()) + " °CA aTDC, beyond ivc_cad = " + text(cylinder.geometry.ivc_cad) +
                      " to evo_cad = " + text(cylinder.geometry.evo_cad) + ": cut it to the closed part");
    }
    if (!trace.point.trapped_mass_g && trace.angle_cad.front() > cylinder.geometry.ivc_cad + engine::ivc_carry_cad) {
      throw DataError("trace '" + trace.label + "' starts at " + text(trace.angle_cad.front()) +
                      " °CA aTDC, ivc_cad = " + text(cylinder.geometry.ivc_cad) +
                      ": give its trapped_mass_g, which p(IVC) does not determine here");
    }
    if (*std::min_element(trace.pressure_bar.begin(), trace.pressure_bar.end()) <= 0.0) {
      throw DataError("trace '" + trace.label + "' has a pressure <= 0 bar: peg it to absolute pressure first");
    }
  }
}

double closed_imep_bar(const MeasuredCycle& trace, const std::vector<double>& pressure_bar,
                       const engine::Geometry<double>& geometry) {
  double work = 0.0;
  for (std::size_t k = 0; k + 1 < pressure_bar.size(); ++k) {
    work += 0.5 * (pressure_bar[k] + pressure_bar[k + 1]) *
            (geometry.volume_m3(trace.angle_cad[k + 1]) - geometry.volume_m3(trace.angle_cad[k]));
  }
  return work / geometry.swept_m3;
}

LoadFit compare(const MeasuredCycle& trace, const engine::Cylinder& cylinder, CylinderResidual& residual,
                std::size_t index, const Eigen::VectorXd& x) {
  CylinderResidual::Simulated model = residual.simulate(index, x);
  const engine::Geometry<double> geometry(cylinder.geometry);
  LoadFit fit;
  fit.burn = residual.burn(index, x);
  fit.p_max_bar = residual.p_max_bar(index);
  double squares = 0.0;
  fit.largest_error_bar = 0.0;
  fit.largest_error_cad = trace.angle_cad.front();
  for (std::size_t k = 0; k < trace.pressure_bar.size(); ++k) {
    const double error = model.pressure_bar[k] - trace.pressure_bar[k];
    squares += error * error;
    if (std::abs(error) > std::abs(fit.largest_error_bar)) {
      fit.largest_error_bar = error;
      fit.largest_error_cad = trace.angle_cad[k];
    }
  }
  fit.rmse_bar = std::sqrt(squares / static_cast<double>(trace.pressure_bar.size()));
  fit.rmse_percent = 100.0 * fit.rmse_bar / fit.p_max_bar;
  fit.imep_closed_bar = closed_imep_bar(trace, trace.pressure_bar, geometry);
  fit.imep_closed_model_bar = closed_imep_bar(trace, model.pressure_bar, geometry);
  fit.imep_closed_error_percent = 100.0 * (fit.imep_closed_model_bar / fit.imep_closed_bar - 1.0);
  fit.ca50_cad = model.indicators.ca50_cad;
  fit.heat_loss_fraction = model.indicators.heat_loss_fraction;
  fit.trapped_mass_g = model.trapped_mass_g;
  fit.model_bar = std::move(model.pressure_bar);
  return fit;
}

// The report has no correlation for a parameter held at its bound; the linearised problem there has.
Eigen::MatrixXd correlation_if_free(const optimize::FitReport& report, CylinderResidual& residual,
                                    const optimize::LeastSquaresOptions& search) {
  if (report.bounds_active.isZero()) return report.correlation;
  Eigen::VectorXd r(residual.n_residuals());
  Eigen::MatrixXd jacobian(residual.n_residuals(), residual.n_parameters());
  if (!residual(report.values, r, &jacobian)) return report.correlation;
  optimize::FitReport free = report;
  free.bounds_active.setZero();
  optimize::describe_uncertainty(free, jacobian, Eigen::VectorXd::Ones(residual.n_parameters()),
                                 {search.correlation_limit, search.rank_tolerance});
  return free.correlation;
}

}  // namespace

std::vector<std::string> load_parameters() {
  std::vector<std::string> names;
  for (const auto& field : load_fields<double>())
    names.emplace_back(field.info.name);
  return names;
}

std::vector<std::string> common_parameters() {
  std::vector<std::string> names;
  for (const auto& field : engine::cylinder_fields<double>()) {
    if (!places_grid(field.info.name) && !is_load_field(field.info.name)) names.emplace_back(field.info.name);
  }
  return names;
}

LoadBurn estimate_burn(const MeasuredCycle& trace, const engine::Cylinder& cylinder) {
  const engine::TraceAnalysis a =
      engine::analyze_trace(trace.angle_cad, trace.pressure_bar, cylinder, trace.point, engine::TraceOptions{});
  if (a.motored || !(a.heat_net_j > 0.0) || std::isnan(a.ca10_cad) || std::isnan(a.ca90_cad) ||
      a.ca90_cad <= a.ca10_cad) {
    throw DataError("trace '" + trace.label +
                    "' shows no heat release: it looks motored, and a burn "
                    "cannot be fitted to it");
  }
  LoadBurn burn;
  burn.start_pressure_bar = trace.pressure_bar.front();
  burn.wiebe_m = cylinder.burn.wiebe_m;
  burn.second_fraction = cylinder.burn.second_fraction;
  burn.second_delay_cad = cylinder.burn.second_delay_cad;
  burn.second_duration_cad = cylinder.burn.second_duration_cad;
  burn.second_wiebe_m = cylinder.burn.second_wiebe_m;
  // Angles of 10 and 90 % of a burn that starts at 0 and lasts 1 CAD give the law's own proportions.
  engine::BurnParameters<double> unit = cylinder.burn;
  if (unit.burn_shape == engine::BurnShape::double_wiebe) unit.burn_shape = engine::BurnShape::wiebe;
  const engine::Burn<double> law(unit, 0.0, 1.0);
  const double s10 = law.angle_of(0.1);
  burn.burn_duration_cad = (a.ca90_cad - a.ca10_cad) / (law.angle_of(0.9) - s10);
  burn.soc_cad = a.ca10_cad - s10 * burn.burn_duration_cad;
  burn.fuel_heat_j = 1.1 * a.heat_net_j;
  if (cylinder.burn.burn_shape == engine::BurnShape::double_wiebe) {
    // Split the single burn into a short first and a long second part; the fit settles their shares.
    burn.second_fraction = 0.6;
    burn.second_delay_cad = 2.0;
    burn.second_duration_cad = 1.3 * burn.burn_duration_cad;
    burn.burn_duration_cad *= 0.6;
    burn.wiebe_m = burn.second_wiebe_m = 1.0;
  }
  for (const auto& field : load_fields<double>()) {
    field.in(burn) = field.info.domain.clamped(field.in(burn));
  }
  return burn;
}

CylinderFit fit_cylinder(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder,
                         const std::vector<LoadBurn>& start, const std::vector<std::string>& free,
                         const CylinderFitOptions& options) {
  check_inputs(traces, cylinder, start, options);
  const Free chosen = resolve(free);
  CylinderResidual residual(traces, cylinder, start, chosen.common, chosen.load, options.step_cad, options.integrator);
  Eigen::VectorXd x(residual.n_parameters());
  Eigen::Index i = 0;
  for (const std::size_t k : chosen.common)
    x[i++] = engine::cylinder_fields<double>()[k].in(cylinder);
  for (std::size_t t = 0; t < traces.size(); ++t) {
    for (const std::size_t k : chosen.load)
      x[i++] = load_fields<double>()[k].in(residual.start(t));
  }
  std::vector<optimize::Parameter> parameters = describe(chosen, traces);
  narrow(parameters, options.bounds);
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    double& own = x[static_cast<Eigen::Index>(k)];
    own = std::clamp(own, parameters[k].lower, parameters[k].upper);
  }
  optimize::LeastSquares search(std::move(parameters), residual.n_residuals(), options.search);
  CylinderFit fit;
  fit.report = search.solve(residual, x);
  fit.correlation_if_free = correlation_if_free(fit.report, residual, options.search);
  fit.cylinder = residual.cylinder(fit.report.values);
  for (std::size_t t = 0; t < traces.size(); ++t) {
    fit.loads.push_back(compare(traces[t], fit.cylinder, residual, t, fit.report.values));
  }
  return fit;
}

}  // namespace mgdd::identify
