#include "mgdd/engine/sensitivity.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::engine {
namespace {

bool places_grid(std::string_view name) noexcept {
  return name == "ivc_cad" || name == "evo_cad";
}

[[noreturn]] void refuse(std::string_view name) {
  std::string valid;
  for (const std::string& n : differentiable_inputs())
    valid.append(valid.empty() ? "" : ", ").append(n);
  throw ParameterError("'" + std::string(name) + "' is not an input with a derivative: must be one of " + valid);
}

template <class T>
T& find_input(CycleInputs<T>& inputs, std::string_view name) {
  if (name == "soc_cad") return inputs.soc_cad;
  if (name == "burn_duration_cad") {
    if (!inputs.point.burn_duration_cad) {
      inputs.point.burn_duration_cad = burn_duration_cad(inputs.cylinder.burn, inputs.point);
    }
    return *inputs.point.burn_duration_cad;
  }
  if (name == "trapped_mass_g") {
    if (!inputs.point.trapped_mass_g) {
      const Geometry<T> geometry(inputs.cylinder.geometry);
      const T intake_pa = inputs.point.intake_pressure_kpa * units::pa_per_kpa;
      const T ivc_pa = intake_pa + inputs.cylinder.gas.ivc_pressure_rise_kpa * units::pa_per_kpa;
      inputs.point.trapped_mass_g =
          mass_of_gas_g(simulated_gas_j_per_k(inputs.cylinder, geometry, inputs.point, intake_pa, ivc_pa));
    }
    return *inputs.point.trapped_mass_g;
  }
  for (const auto& field : operating_point_fields<T>()) {
    if (field.info.name == name) return field.in(inputs.point);
  }
  for (const auto& field : cylinder_fields<T>()) {
    if (field.info.name == name && !places_grid(name)) return field.in(inputs.cylinder);
  }
  refuse(name);
}

Indicators<double> simulate_indicators(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                                       double step_cad, Integrator integrator) {
  const CycleModel<double> model(cylinder, crank_grid(cylinder, step_cad), integrator);
  CycleWorkspace<double> work = model.make_workspace();
  const Charge<double> charge = model.charge(point);
  model.run(charge, soc_cad, work);
  model.require_physical(work);
  return model.indicators(charge, soc_cad, work);
}

}  // namespace

std::vector<std::string> differentiable_inputs() {
  std::vector<std::string> names{"soc_cad", "burn_duration_cad", "trapped_mass_g"};
  for (const auto& field : operating_point_fields<double>())
    names.emplace_back(field.info.name);
  for (const auto& field : cylinder_fields<double>()) {
    if (!places_grid(field.info.name)) names.emplace_back(field.info.name);
  }
  return names;
}

std::string_view input_unit(std::string_view name) {
  if (name == "soc_cad") return "°CA aTDC";
  for (const FieldInfo& info : {burn_duration_info, trapped_mass_info}) {
    if (info.name == name) return info.unit;
  }
  for (const auto& field : operating_point_fields<double>()) {
    if (field.info.name == name) return field.info.unit;
  }
  for (const auto& field : cylinder_fields<double>()) {
    if (field.info.name == name && !places_grid(name)) return field.info.unit;
  }
  refuse(name);
}

double& input(CycleInputs<double>& inputs, std::string_view name) {
  return find_input(inputs, name);
}
Dual<1>& input(CycleInputs<Dual<1>>& inputs, std::string_view name) {
  return find_input(inputs, name);
}
SensitivityScalar& input(CycleInputs<SensitivityScalar>& inputs, std::string_view name) {
  return find_input(inputs, name);
}

Sensitivities sensitivities(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                            const std::vector<std::string>& names, double step_cad, Integrator integrator) {
  validate_cycle(cylinder, point, soc_cad);
  Sensitivities out;
  out.value = simulate_indicators(cylinder, point, soc_cad, step_cad, integrator);
  out.names = names;
  out.angles_cad = crank_grid(cylinder, step_cad);
  const std::size_t n = out.angles_cad.size();
  out.pressure_bar.resize(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(names.size()));
  // All names first: a wrong one is refused before any work, and an optional that is asked for is a constant of the
  // point in every pass, whichever inputs share its lanes.
  CycleInputs<double> base{cylinder, point, soc_cad};
  for (const std::string& name : names)
    static_cast<void>(input(base, name));
  constexpr auto lanes = static_cast<std::size_t>(sensitivity_lanes);
  for (std::size_t first = 0; first < names.size(); first += lanes) {
    CycleInputs<SensitivityScalar> inputs{lift<SensitivityScalar>(base.cylinder), lift<SensitivityScalar>(base.point),
                                          soc_cad};
    const std::size_t count = std::min(lanes, names.size() - first);
    for (std::size_t lane = 0; lane < count; ++lane) {
      SensitivityScalar& variable = input(inputs, names[first + lane]);
      variable = SensitivityScalar::seeded(variable.value, static_cast<int>(lane));
    }
    const CycleModel<SensitivityScalar> model(inputs.cylinder, out.angles_cad, integrator);
    CycleWorkspace<SensitivityScalar> work = model.make_workspace();
    const Charge<SensitivityScalar> charge = model.charge(inputs.point);
    model.run(charge, inputs.soc_cad, work);
    const Indicators<SensitivityScalar> all = model.indicators(charge, inputs.soc_cad, work);
    for (std::size_t lane = 0; lane < count; ++lane) {
      out.indicators.push_back(derivatives(all, lane));
      for (std::size_t k = 0; k < n; ++k) {
        out.pressure_bar(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(first + lane)) =
            work.pressure_pa[k].grad[lane] / units::pa_per_bar;
      }
    }
  }
  return out;
}

std::vector<ConvergenceEstimate> convergence(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                                             double step_cad, Integrator integrator) {
  validate_cycle(cylinder, point, soc_cad);
  if (!(step_cad >= 4.0 * step_lower_cad)) {
    throw ParameterError("step_cad", step_cad, "the estimate also runs a quarter of it, so it must be >= 0.004", "°CA");
  }
  const Indicators<double> coarse = simulate_indicators(cylinder, point, soc_cad, step_cad, integrator);
  const Indicators<double> middle = simulate_indicators(cylinder, point, soc_cad, step_cad / 2, integrator);
  const Indicators<double> fine = simulate_indicators(cylinder, point, soc_cad, step_cad / 4, integrator);
  std::vector<ConvergenceEstimate> out;
  for (const auto& field : indicator_fields<double>()) {
    const double first = coarse.*(field.member) - middle.*(field.member);
    const double second = middle.*(field.member) - fine.*(field.member);
    const double ratio = first / second;
    // The observed order where the differences shrink regularly; else the scheme's first order on the last pair.
    const bool regular = ratio > 1.2 && ratio < 20.0;
    const double shrink = regular ? ratio : 2.0;
    const double limit = fine.*(field.member) - second / (shrink - 1.0);
    out.push_back({field.name, field.unit, coarse.*(field.member), limit, coarse.*(field.member) - limit,
                   regular ? std::log2(ratio) : std::numeric_limits<double>::quiet_NaN()});
  }
  return out;
}

}  // namespace mgdd::engine
